//! The files of the page, inside the program.

use super::problem::Problem;
use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::borrow::Cow;
use std::sync::LazyLock;
use twox_hash::XxHash3_64;

/// A file: its name in the address, and its content.
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

/// Directory of files that replace those in the program, so that a page can be edited without a new build.
#[cfg(debug_assertions)]
const DIRECTORY: &str = "COMMRAM_WEB_ASSETS";

/// The files with the tags by which a browser recognizes a version.
static TAGGED: LazyLock<Vec<(Asset, HeaderValue)>> =
    LazyLock::new(|| ASSETS.iter().map(|asset| (*asset, tag(asset.1))).collect());

fn tag(content: &[u8]) -> HeaderValue {
    let text = format!("\"{:016x}\"", XxHash3_64::oneshot(content));
    HeaderValue::from_str(&text).unwrap_or(HeaderValue::from_static("\"\""))
}

/// The file at a path of the address.
pub(super) fn answer(path: &str, request: &HeaderMap) -> Response {
    let name = path.strip_prefix('/').filter(|name| !name.is_empty()).unwrap_or("index.html");
    let Some(((name, content), tag)) = TAGGED.iter().find(|((known, _), _)| *known == name) else {
        return Problem::not_found(format!("there is no page {path}")).into_response();
    };
    let (content, tag) = match edited(name) {
        Some(edited) => (Cow::Owned(edited), HeaderValue::from_static("W/\"edited\"")),
        None => (Cow::Borrowed(*content), tag.clone()),
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

/// The file in the directory of edited files.
#[cfg(debug_assertions)]
fn edited(name: &str) -> Option<Vec<u8>> {
    std::fs::read(std::path::PathBuf::from(std::env::var_os(DIRECTORY)?).join(name)).ok()
}

/// A released program uses only the files in it.
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

    /// The first page must appear quickly, and the program must stay small.
    #[test]
    fn the_files_are_small_and_of_a_known_type() {
        assert!(ASSETS.iter().map(|(_, content)| content.len()).sum::<usize>() <= 200 * 1024);
        for (name, _) in ASSETS {
            assert_ne!(media_type(name), "application/octet-stream", "{name}");
        }
    }
}
