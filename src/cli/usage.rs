//! Reads the command line; where it cannot be read, says what was meant as far as that can be told.

use super::args::Cli;
use super::print;
use super::refused::{Refused, Result};
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use cutis::scene::nearest;
use std::ffi::{OsStr, OsString};
use std::path::Path;

/// Arguments of the program; none where help or version was asked for, which is printed here.
pub fn read(words: &[OsString]) -> Result<Option<Cli>> {
    if let Some(word) = words.get(1)
        && is_neither_scene_nor_option(word)
        && !commands().iter().any(|command| word == command.as_str())
    {
        let known = commands();
        let word = word.to_string_lossy().into_owned();
        let known: Vec<&str> = known.iter().map(String::as_str).collect();
        return Err(Refused::NoCommand { nearest: nearest(&word, &known).map(String::from), word });
    }
    match Cli::try_parse_from(words) {
        Ok(cli) => Ok(Some(cli)),
        Err(error) if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            print::written(error.print()).map(|()| None)
        }
        Err(error) => Err(match (error.kind(), command_behind(words)) {
            (ErrorKind::ArgumentConflict, Some(command)) => Refused::OptionBeforeCommand { command },
            _ => Refused::Usage { error },
        }),
    }
}

fn is_neither_scene_nor_option(word: &OsStr) -> bool {
    let text = word.to_string_lossy();
    !text.is_empty() && !text.starts_with('-') && !text.contains(['.', '/', '\\']) && !Path::new(word).exists()
}

/// Names of the commands.
fn commands() -> Vec<String> {
    let help = ["help".to_string()].into_iter();
    Cli::command().get_subcommands().map(|command| command.get_name().to_string()).chain(help).collect()
}

/// Command that stands behind options of its own.
fn command_behind(words: &[OsString]) -> Option<String> {
    commands().into_iter().find(|name| words.iter().skip(2).any(|word| word == name.as_str()))
}
