//! Formats of other loggers that commram does not read, and the programs that convert them.

use std::path::Path;

/// A format: its name, the extension of its files, and the first characters of a file or of a line of its head.
struct Format {
    name: &'static str,
    extension: &'static str,
    beginnings: &'static [&'static str],
}

const FORMATS: &[Format] = &[
    Format { name: "ASC of Vector", extension: "asc", beginnings: &["date ", "base hex", "base dec"] },
    Format { name: "BLF of Vector", extension: "blf", beginnings: &["LOGG"] },
    Format { name: "TRC of PEAK", extension: "trc", beginnings: &[";$FILEVERSION=", ";##"] },
    Format { name: "MF4 of ASAM", extension: "mf4", beginnings: &["MDF "] },
    Format { name: "CSV of python-can", extension: "csv", beginnings: &["timestamp,arbitration_id,"] },
    Format { name: "SQLite of python-can", extension: "db", beginnings: &["SQLite format 3"] },
];

/// Number of lines at the beginning of a file in which [`conversion`] searches.
const HEAD_LINES: usize = 3;

/// Returns the name of the file's format and the commands that convert it, if the format belongs to another logger. A
/// format is recognized by the content of the file. If the content is not known, the extension decides.
pub(super) fn conversion(path: &Path, bytes: &[u8]) -> Option<String> {
    let head: Vec<&[u8]> = bytes.split(|byte| *byte == b'\n').take(HEAD_LINES).collect();
    let begins = |format: &&Format| {
        let mut beginnings = format.beginnings.iter();
        beginnings.any(|beginning| head.iter().any(|line| line.starts_with(beginning.as_bytes())))
    };
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let is_named =
        |format: &&Format| format.extension == extension.to_ascii_lowercase() && extension != "csv";
    let format = FORMATS.iter().find(begins).or_else(|| FORMATS.iter().find(is_named))?;
    // The commands contain the name of the file. If a shell would change this name, they contain an example instead.
    let is_plain = |name: &&str| {
        !name.starts_with('-')
            && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"/._-+".contains(&byte))
    };
    let example = format!("recording.{}", format.extension);
    let source = path.to_str().filter(is_plain).filter(|_| !extension.is_empty()).unwrap_or(&example);
    let mut target = Path::new(source).with_extension("log");
    // A converter that overwrites its input destroys it.
    if target == Path::new(source) {
        target.set_extension("candump.log");
    }
    let target = target.display();
    let mut text = format!(
        "the format is {}; `can_logconvert {source} {target}` of python-can converts it",
        format.name
    );
    if format.extension == "asc" {
        text += &format!(", as does `asc2log -I {source} -O {target}` of can-utils");
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_formats_are_named_with_their_converter() {
        for (path, head, wanted) in [
            (
                "a.asc",
                "date Sam Sep 30 2017\nbase hex  timestamps absolute\n",
                "the format is ASC of Vector; `can_logconvert a.asc a.log`",
            ),
            ("x", "\r\nbase dec\r\n", "`asc2log -I recording.asc -O recording.log` of can-utils"),
            ("/tmp/My Log.BLF", "LOGG\u{90}", "`can_logconvert recording.blf recording.log` of python-can"),
            ("d/b.trc", ";$FILEVERSION=2.1\n", "`can_logconvert d/b.trc d/b.log`"),
            ("b.trc", "1 2 3", "TRC of PEAK"),
            ("b.csv", "timestamp,arbitration_id,extended\n", "CSV of python-can"),
            ("d/b.log", "LOGG", "`can_logconvert d/b.log d/b.candump.log`"),
            ("b.log", "date Sam Sep 30 2017\n", "`asc2log -I b.log -O b.candump.log`"),
            ("-", "SQLite format 3\0", "`can_logconvert recording.db recording.log`"),
        ] {
            let text = conversion(Path::new(path), head.as_bytes()).unwrap_or_default();
            assert!(text.contains(wanted), "{path}: {text}");
            assert_eq!(text.contains("asc2log"), text.contains("ASC"), "{text}");
        }
    }

    #[test]
    fn own_formats_need_no_converter() {
        for (path, head) in [
            ("a.log", "(1436509052.249713) can0 123#AA\n"),
            ("a.csv", "Time Stamp,ID,Extended,Dir,Bus,LEN,D1\n"),
            ("a", ""),
            ("a.jsonl", "{\"v\":1}\n"),
        ] {
            assert_eq!(conversion(Path::new(path), head.as_bytes()), None, "{path}");
        }
    }
}
