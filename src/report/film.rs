//! Films: animated PNG files, which browsers show.

use crate::error::Result;
use crate::output::Failed;
use crate::view::Image;
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Number of pictures that a film is begun with; the file has the true one once it is whole.
const UNKNOWN: u32 = 1 << 30;
/// Bytes of a PNG file among which the chunk with the number of pictures is.
const HEAD: usize = 256;
/// Shortest and longest time of a picture.
const SHORTEST: Duration = Duration::from_millis(10);
const LONGEST: Duration = Duration::from_secs(60);

/// A film in the making. It has its name once it is whole; until then, and where it is dropped before, there is no file of that name.
pub struct Film {
    path: PathBuf,
    unfinished: PathBuf,
    writer: Option<png::Writer<BufWriter<File>>>,
    size: [u32; 2],
    count: u32,
}

/// A time as a fraction of a second that films have, to the millisecond.
pub fn milliseconds(time: Duration) -> [u16; 2] {
    [time.clamp(SHORTEST, LONGEST).as_millis() as u16, 1000]
}

impl Film {
    /// Begins a film of pictures of one size, pixels.
    ///
    /// # Errors
    /// [`Failed::Write`].
    pub fn new(path: &Path, size: [u32; 2]) -> Result<Self> {
        let mut name = path.as_os_str().to_owned();
        name.push(".tmp");
        let unfinished = PathBuf::from(name);
        let failed = |source| Failed::Write { path: unfinished.clone(), source };
        let file = BufWriter::new(File::create(&unfinished).map_err(failed)?);
        let begin = || -> std::result::Result<_, png::EncodingError> {
            let mut encoder = png::Encoder::new(file, size[0], size[1]);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_depth(png::BitDepth::Eight);
            encoder.set_animated(UNKNOWN, 0)?;
            encoder.write_header()
        };
        let writer = begin().map_err(|error| failed(error.into()))?;
        Ok(Self { path: path.to_owned(), unfinished, writer: Some(writer), size, count: 0 })
    }

    /// Number of pictures so far.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Size of the pictures, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Adds a picture that is shown for a fraction of a second.
    ///
    /// # Errors
    /// [`Failed::Write`], also of a picture of another size.
    pub fn add(&mut self, image: &Image, [share, of]: [u16; 2]) -> Result<()> {
        let failed = |source| Failed::Write { path: self.unfinished.clone(), source };
        let Some(writer) = &mut self.writer else { return Ok(()) };
        if [image.width, image.height] != self.size {
            return Err(failed(io::Error::other("a picture of another size")).into());
        }
        let added = writer.set_frame_delay(share, of).and_then(|()| writer.write_image_data(&image.rgb));
        added.map_err(|error| failed(error.into()))?;
        self.count += 1;
        Ok(())
    }

    /// Closes the film and gives it its name.
    ///
    /// # Errors
    /// [`Failed::Write`], also of a film without pictures.
    pub fn finish(mut self) -> Result<()> {
        let failed = |source| Failed::Write { path: self.path.clone(), source };
        let Some(writer) = self.writer.take() else { return Ok(()) };
        writer.finish().map_err(|error| failed(error.into()))?;
        set_count(&self.unfinished, self.count).map_err(failed)?;
        Ok(std::fs::rename(&self.unfinished, &self.path).map_err(failed)?)
    }
}

impl Drop for Film {
    fn drop(&mut self) {
        // what was renamed is not there any more
        self.writer = None;
        std::fs::remove_file(&self.unfinished).ok();
    }
}

/// Writes the number of pictures into the file's `acTL` chunk: number, plays, and their CRC-32 with the chunk's name.
fn set_count(path: &Path, count: u32) -> io::Result<()> {
    let mut file = File::options().read(true).write(true).open(path)?;
    let mut head = vec![];
    (&file).take(HEAD as u64).read_to_end(&mut head)?;
    let missing = || io::Error::other("no chunk with the number of pictures");
    let at = head.windows(4).position(|name| name == b"acTL").ok_or_else(missing)?;
    let mut chunk = head.get(at..at + 12).ok_or_else(missing)?.to_vec();
    chunk[4..8].copy_from_slice(&count.to_be_bytes());
    let mut crc = flate2::Crc::new();
    crc.update(&chunk);
    chunk.extend(crc.sum().to_be_bytes());
    file.seek(SeekFrom::Start(at as u64))?;
    file.write_all(&chunk)
}

/// Shortest time between two pictures: 12.5 a second at most.
const BETWEEN: Duration = Duration::from_millis(80);

/// A film of pictures with their times by the wall clock. A picture is written once the next one tells how long it was seen.
pub struct Filming {
    film: Film,
    path: PathBuf,
    last: (Image, Instant),
}

impl Filming {
    /// Begins with a picture.
    ///
    /// # Errors
    /// As [`Film::new`].
    pub fn new(path: &Path, first: Image) -> Result<Self> {
        let film = Film::new(path, [first.width, first.height])?;
        Ok(Self { film, path: path.to_owned(), last: (first, Instant::now()) })
    }

    /// Whether another picture is due.
    pub fn is_due(&self) -> bool {
        self.last.1.elapsed() >= BETWEEN
    }

    /// Whether a picture of this size fits.
    pub fn fits(&self, size: [u32; 2]) -> bool {
        self.film.size() == size
    }

    /// Takes the next picture.
    ///
    /// # Errors
    /// As [`Film::add`].
    pub fn add(&mut self, next: Image) -> Result<()> {
        let now = Instant::now();
        let (last, seen) = std::mem::replace(&mut self.last, (next, now));
        self.film.add(&last, milliseconds(now - seen))
    }

    /// Ends the film; what became of it, in words.
    pub fn end(mut self) -> String {
        let (last, seen) = &self.last;
        let ended = self.film.add(last, milliseconds(seen.elapsed().max(BETWEEN))).map(|()| self.film.count());
        match ended.and_then(|count| self.film.finish().map(|()| count)) {
            Ok(count) => format!("saved {} with {count} pictures", self.path.display()),
            Err(error) => error.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(gray: u8) -> Image {
        Image { width: 7, height: 5, rgb: vec![gray; 105], skipped: 0 }
    }

    #[test]
    fn a_film_has_its_pictures_with_their_times_and_its_name_when_it_is_whole() {
        let folder = std::env::temp_dir().join(format!("cutis-film-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let path = folder.join("film.png");
        let mut film = Film::new(&path, [7, 5]).expect("a film");
        let times = [[1, 30], milliseconds(Duration::from_millis(40)), milliseconds(Duration::from_secs(100))];
        for (gray, time) in [10, 20, 30].into_iter().zip(times) {
            film.add(&picture(gray), time).expect("a picture");
        }
        let wide = Image { width: 8, ..picture(0) };
        assert!(film.add(&wide, times[0]).is_err_and(|error| error.to_string().contains("another size")));
        assert!(!path.exists() && film.count() == 3 && film.size() == [7, 5]);
        film.finish().expect("a whole film");
        let mut reader =
            png::Decoder::new(io::BufReader::new(File::open(&path).expect("the film"))).read_info().expect("a PNG");
        assert_eq!(reader.info().animation_control().map(|control| control.num_frames), Some(3));
        let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
        for (gray, time) in [10, 20, 30].into_iter().zip(times) {
            reader.next_frame(&mut bytes).expect("a frame");
            let control = reader.info().frame_control().expect("its time");
            let shown = f64::from(control.delay_num) / f64::from(control.delay_den);
            let [share, of] = time.map(f64::from);
            assert!(bytes.iter().all(|b| *b == gray) && (shown - share / of).abs() < 1e-9, "{gray}: {shown} s");
        }
        assert!(reader.next_frame(&mut bytes).is_err());
        // one that is given up leaves nothing
        drop(Film::new(&folder.join("other.png"), [7, 5]).expect("a film"));
        let left: Vec<_> = std::fs::read_dir(&folder).expect("the folder").collect();
        assert_eq!(left.len(), 1, "{left:?}");
        std::fs::remove_dir_all(&folder).ok();
    }
}
