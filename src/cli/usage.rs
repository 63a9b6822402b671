//! Reads the command line; where it cannot be read, says what was meant as far as that can be told.

use super::args::Cli;
use super::print;
use super::refused::{Refused, Result};
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use std::ffi::{OsStr, OsString};
use std::path::Path;

/// Arguments of the program; none where help or version was asked for, which is printed here.
pub fn read(words: &[OsString]) -> Result<Option<Cli>> {
    if let Some(word) = words.get(1)
        && looks_like_command(word)
        && let Some(error) = unknown_command(word)
    {
        return Err(Refused::Usage { error });
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

/// Neither an option nor the path of a scene.
fn looks_like_command(word: &OsStr) -> bool {
    let text = word.to_string_lossy();
    !text.is_empty() && !text.starts_with('-') && !text.contains(['.', '/', '\\']) && !Path::new(word).exists()
}

/// The parser's error for a command that there is not; it names the nearest.
fn unknown_command(word: &OsStr) -> Option<clap::Error> {
    let commands = Cli::command().get_subcommands().cloned().collect::<Vec<_>>();
    let parser = clap::Command::new("cutis").subcommands(commands).subcommand_required(true);
    let error = parser.try_get_matches_from([OsStr::new("cutis"), word]).err()?;
    (error.kind() == ErrorKind::InvalidSubcommand).then_some(error)
}

/// Command that stands behind options of its own.
fn command_behind(words: &[OsString]) -> Option<String> {
    let known = Cli::command();
    let mut names = known.get_subcommands().map(|command| command.get_name());
    names.find(|name| words.iter().skip(2).any(|word| word == name)).map(String::from)
}
