//! The files of the page, built into the program.

use super::problem::Problem;
use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::borrow::Cow;
use std::sync::LazyLock;
use twox_hash::XxHash3_64;

/// A file of the page: its name in the address, and its content.
type Asset = (&'static str, &'static [u8]);

macro_rules! assets {
    ($($name:literal)*) => {
        &[$(($name, include_bytes!(concat!("assets/", $name)))),*]
    };
}

/// All files; `index.html` is also the page `/`.
const ASSETS: &[Asset] = assets! {
    "actions.js"
    "api.js"
    "app.js"
    "bus.js"
    "chart.js"
    "clock.js"
    "conditions.js"
    "dialogs.js"
    "dom.js"
    "drives.js"
    "faults.js"
    "feed.js"
    "findings.js"
    "followed.js"
    "foreign.js"
    "icon.svg"
    "index.html"
    "journal.js"
    "led.js"
    "list.js"
    "map.js"
    "messages.js"
    "objects.js"
    "pages.css"
    "pages.js"
    "panel.js"
    "pins.js"
    "plant.js"
    "record.js"
    "register.js"
    "registers.js"
    "sdo.js"
    "style.css"
    "switch.js"
    "values.js"
};

/// Environment variable with a directory. Its files replace those in the program, so that a page can be edited without
/// a new build.
#[cfg(debug_assertions)]
const DIRECTORY: &str = "COMMRAM_WEB_ASSETS";

/// A file as it is served.
struct ServedFile {
    name: &'static str,
    content: Cow<'static, [u8]>,
    /// Tag of the content (ETag). A browser compares it to recognize a version of the file.
    tag: HeaderValue,
}

static SERVED: LazyLock<Vec<ServedFile>> = LazyLock::new(|| {
    let served = |(name, content): &Asset| {
        let content = without_comments(name, content);
        let tag = tag(&content);
        ServedFile { name, content, tag }
    };
    ASSETS.iter().map(served).collect()
});

/// Removes the comment lines of a file: a browser must load all files before the page is complete.
fn without_comments(name: &str, content: &'static [u8]) -> Cow<'static, [u8]> {
    let (true, Ok(text)) = (name.ends_with(".js") || name.ends_with(".css"), str::from_utf8(content)) else {
        return Cow::Borrowed(content);
    };
    let mut is_inside = false;
    let is_code = |line: &&str| {
        let line = line.trim();
        is_inside |= line.starts_with("/*");
        let is_comment = is_inside || line.starts_with("//");
        is_inside &= !line.ends_with("*/");
        !is_comment
    };
    Cow::Owned(text.split_inclusive('\n').filter(is_code).collect::<String>().into_bytes())
}

fn tag(content: &[u8]) -> HeaderValue {
    let text = format!("\"{:016x}\"", XxHash3_64::oneshot(content));
    HeaderValue::from_str(&text).unwrap_or(HeaderValue::from_static("\"\""))
}

/// Returns the file at this path of the address.
pub(super) fn answer(path: &str, request: &HeaderMap) -> Response {
    let name = path.strip_prefix('/').filter(|name| !name.is_empty()).unwrap_or("index.html");
    let Some(ServedFile { name, content, tag }) = SERVED.iter().find(|known| known.name == name) else {
        return Problem::not_found(format!("there is no page {path}")).into_response();
    };
    let (content, tag) = match edited(name) {
        Some(edited) => (Cow::Owned(edited), HeaderValue::from_static("W/\"edited\"")),
        None => (Cow::Borrowed(content.as_ref()), tag.clone()),
    };
    let is_known = request.get(header::IF_NONE_MATCH).is_some_and(|known| *known == tag);
    let mut response = match (&content, is_known) {
        (Cow::Borrowed(_), true) => StatusCode::NOT_MODIFIED.into_response(),
        _ => Response::new(Body::from(content)),
    };
    let headers = response.headers_mut();
    headers.insert(header::ETAG, tag);
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type(name)));
    response
}

/// Returns a file from the directory of edited files, if it exists.
#[cfg(debug_assertions)]
fn edited(name: &str) -> Option<Vec<u8>> {
    std::fs::read(std::path::PathBuf::from(std::env::var_os(DIRECTORY)?).join(name)).ok()
}

/// A release build uses only the files in the program.
#[cfg(not(debug_assertions))]
fn edited(_: &str) -> Option<Vec<u8>> {
    None
}

fn media_type(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("woff2") => "font/woff2",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The page must appear quickly, and the program must stay small.
    #[test]
    fn the_files_are_small_and_of_a_known_type() {
        assert!(SERVED.iter().map(|file| file.content.len()).sum::<usize>() <= 200 * 1024);
        for ServedFile { name, .. } in SERVED.iter() {
            assert_ne!(media_type(name), "application/octet-stream", "{name}");
        }
    }

    #[test]
    fn lines_of_comments_are_not_served() {
        let text = b"// One.\nlet a = 1; // two\n  /** Three.\n   * four */\n  a();\n";
        assert_eq!(&*without_comments("a.js", text), b"let a = 1; // two\n  a();\n");
        assert_eq!(&*without_comments("a.svg", text), text);
    }
}
