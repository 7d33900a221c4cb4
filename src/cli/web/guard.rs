//! Checks the host, the origin and the token of a request before its handler runs. Also adds the headers that every
//! response has.

use super::connections::Peer;
use super::problem::Problem;
use super::secret::Secret;
use super::session::{SessionEnd, Sessions, bearer};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Request, StatusCode, Uri, header};
use std::net::IpAddr;
use std::sync::Arc;

/// Headers of every response. They forbid inline code, content from other hosts, and display in a frame.
const HEADERS: [(HeaderName, &str); 6] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; font-src 'self'; connect-src 'self'; \
         frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
];

/// An address at which browsers reach the server: `https://plant.example`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Origin {
    text: String,
    /// Host with the port, as in a `Host` header.
    authority: String,
}

impl Origin {
    /// Parses the argument of `--origin`.
    ///
    /// # Errors
    /// The text does not have the form `http://HOST:PORT` or `https://HOST`.
    pub(super) fn parse(text: &str) -> Result<Self, &'static str> {
        const RIGHT: &str = "write http://HOST:PORT or https://HOST, without a path";
        let uri: Uri = text.trim_end_matches('/').parse().map_err(|_| RIGHT)?;
        let authority =
            uri.authority().map(|authority| authority.as_str().to_ascii_lowercase()).ok_or(RIGHT)?;
        let scheme = uri.scheme_str().filter(|scheme| ["http", "https"].contains(scheme)).ok_or(RIGHT)?;
        let host = uri.host().unwrap_or_default();
        let is_host = !host.is_empty()
            && host.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".-_[]:".contains(&byte));
        let has_port = authority.len() == host.len() || uri.port_u16().is_some();
        if !is_host || !has_port || authority.contains('@') || uri.path() != "/" || uri.query().is_some() {
            return Err(RIGHT);
        }
        // Browsers leave out the default port.
        let default_port = if scheme == "http" { ":80" } else { ":443" };
        let authority = authority.strip_suffix(default_port).unwrap_or(&authority).to_owned();
        Ok(Self { text: format!("{scheme}://{authority}"), authority })
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }
}

/// The requirements that every request must meet.
pub(super) struct Guard {
    /// The token of the server. Programs send the token with each request, and browsers exchange it for a key.
    pub token: Secret,
    /// Keys of the clients that are signed in.
    pub sessions: Sessions,
    pub origins: Vec<Origin>,
}

impl Guard {
    /// Checks a request before its handler runs.
    ///
    /// # Errors
    /// The request does not meet a requirement; the error is the response.
    pub(super) fn check<B>(&self, request: &Request<B>) -> Result<(), Problem> {
        let headers = request.headers();
        let host = self.check_host(headers)?;
        check_target(request.uri(), host)?;
        if !request.uri().path().starts_with("/api/") {
            return Ok(());
        }
        self.check_origin(headers, host)?;
        check_content_type(request.method(), headers)?;
        let is_sign_in = request.method() == Method::POST && request.uri().path() == super::session::PATH;
        if is_sign_in || self.is_signed_in(headers) {
            if let Some(peer) = request.extensions().get::<Arc<Peer>>().filter(|_| !is_sign_in) {
                peer.trust();
            }
            return Ok(());
        }
        let detail = "no valid token: send `Authorization: Bearer TOKEN`, or open the address that `commram web` printed";
        Err(Problem::new(StatusCode::UNAUTHORIZED, "unauthorized", detail))
    }

    /// Refuses other host names than `localhost` and the hosts of `--origin`; accepts all addresses. Another site could
    /// point its own host name to this server (DNS rebinding).
    fn check_host<'a>(&self, headers: &'a HeaderMap) -> Result<&'a str, Problem> {
        let mut hosts = headers.get_all(header::HOST).iter();
        let host = match (hosts.next().and_then(|host| host.to_str().ok()), hosts.next()) {
            (Some(host), None) => host,
            _ => return Err(Problem::wrong_use("a request needs one Host header")),
        };
        let is_own = self.origins.iter().any(|origin| origin.authority.eq_ignore_ascii_case(host));
        if is_own || is_address(host) {
            return Ok(host);
        }
        let detail = format!("this server is not {host}; name the address of a proxy with --origin");
        Err(Problem::new(StatusCode::MISDIRECTED_REQUEST, "host", detail))
    }

    /// Refuses requests that a page of another site has sent.
    fn check_origin(&self, headers: &HeaderMap, host: &str) -> Result<(), Problem> {
        let is_own = |origin: &HeaderValue| {
            let origin = origin.to_str().unwrap_or_default();
            let same = origin.strip_prefix("http://").is_some_and(|origin| origin.eq_ignore_ascii_case(host));
            same && is_address(host)
                || self.origins.iter().any(|known| known.text.eq_ignore_ascii_case(origin))
        };
        let is_foreign = headers.get_all(header::ORIGIN).iter().any(|origin| !is_own(origin));
        let site = headers.get("sec-fetch-site").and_then(|site| site.to_str().ok());
        if is_foreign || matches!(site, Some("cross-site" | "same-site")) {
            let detail = "a page of another site has sent this request";
            return Err(Problem::new(StatusCode::FORBIDDEN, "foreign-origin", detail));
        }
        Ok(())
    }

    /// True if the request has the token, or the key of a session.
    pub(super) fn is_signed_in(&self, headers: &HeaderMap) -> bool {
        let is_valid = |secret: &str| self.token.is(secret.as_bytes()) || self.sessions.contains(secret);
        bearer(headers).is_some_and(is_valid)
    }

    /// Returns the session of a request: its key. All requests with the token share one session with an empty key.
    pub(super) fn session_of(&self, headers: &HeaderMap) -> String {
        bearer(headers).filter(|key| self.sessions.contains(key)).unwrap_or_default().to_owned()
    }

    /// Notes that a request opens an event stream, and returns the end of its session.
    pub(super) fn stream_of(&self, headers: &HeaderMap) -> SessionEnd {
        let secret = bearer(headers).unwrap_or_default();
        if self.token.is(secret.as_bytes()) { SessionEnd::NEVER } else { self.sessions.stream(secret) }
    }
}

/// Refuses a POST without JSON: an HTML form of another site can send a POST with other content types, without a
/// preflight request.
fn check_content_type(method: &Method, headers: &HeaderMap) -> Result<(), Problem> {
    if *method != Method::POST {
        return Ok(());
    }
    let found = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let media_type = found.split(';').next().unwrap_or_default().trim();
    if media_type.eq_ignore_ascii_case("application/json") {
        return Ok(());
    }
    let detail = "a POST needs `Content-Type: application/json`";
    Err(Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "media-type", detail))
}

/// Refuses an absolute target, `POST http://HOST/...`, with another host than the header `Host`.
fn check_target(target: &Uri, host: &str) -> Result<(), Problem> {
    match target.authority().map(|authority| authority.as_str()) {
        Some(named) if !named.eq_ignore_ascii_case(host) => {
            let detail = format!("the request is for {named}, and its Host header names {host}");
            Err(Problem::new(StatusCode::MISDIRECTED_REQUEST, "host", detail))
        }
        _ => Ok(()),
    }
}

/// True for an IP address or `localhost`, with or without a port.
fn is_address(host: &str) -> bool {
    let bracketed = host.strip_prefix('[').and_then(|host| host.split_once(']'));
    let (name, port) = match bracketed {
        Some((name, rest)) => (name, rest.strip_prefix(':').or(rest.is_empty().then_some("0"))),
        None => match host.split_once(':') {
            Some((name, port)) => (name, Some(port)),
            None => (host, Some("0")),
        },
    };
    let is_name = name.parse::<IpAddr>().is_ok_and(|ip| ip.is_ipv6() == bracketed.is_some());
    port.is_some_and(|port| port.parse::<u16>().is_ok())
        && (is_name || bracketed.is_none() && name.eq_ignore_ascii_case("localhost"))
}

/// Adds the headers that every response has.
pub(super) fn protect(headers: &mut HeaderMap) {
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guard() -> Guard {
        Guard {
            token: Secret::random().unwrap(),
            sessions: Sessions::default(),
            origins: vec![Origin::parse("https://plant.example/").unwrap()],
        }
    }

    fn headers(pairs: &[(&str, &str)]) -> HeaderMap {
        let pair = |(name, value): &(&str, &str)| {
            (name.parse::<HeaderName>().unwrap(), HeaderValue::from_str(value).unwrap())
        };
        pairs.iter().map(pair).collect()
    }

    #[test]
    fn only_addresses_and_named_hosts_are_accepted() {
        for host in
            ["127.0.0.1:8080", "127.0.0.1", "[::1]:80", "[::1]", "localhost:1", "LOCALHOST", "plant.example"]
        {
            assert!(guard().check_host(&headers(&[("host", host)])).is_ok(), "{host}");
        }
        for host in [
            "evil.example",
            "127.0.0.1.evil.example",
            "localhost.evil.example",
            "::1",
            "[::1",
            "[::1]x",
            "127.0.0.1:x",
            "127.0.0.1:99999",
            "",
            "[127.0.0.1]",
            "user@127.0.0.1",
            "plant.example:1",
        ] {
            assert!(guard().check_host(&headers(&[("host", host)])).is_err(), "{host}");
        }
        let mut two = headers(&[("host", "localhost")]);
        two.append("host", HeaderValue::from_static("localhost"));
        assert!(guard().check_host(&two).is_err() && guard().check_host(&HeaderMap::new()).is_err());
    }

    #[test]
    fn requests_of_other_sites_are_refused() {
        let check = |pairs: &[(&str, &str)]| guard().check_origin(&headers(pairs), "127.0.0.1:8080").is_ok();
        assert!(check(&[]) && check(&[("origin", "http://127.0.0.1:8080")]));
        let proxied = |origin| guard().check_origin(&headers(&[("origin", origin)]), "plant.example").is_ok();
        assert!(proxied("https://plant.example") && !proxied("http://plant.example"));
        for (named, sent) in [
            ("https://plant.example:443", "https://plant.example"),
            ("http://plant.example:80/", "http://plant.example"),
            ("https://plant.example:80", "https://plant.example:80"),
        ] {
            assert_eq!(
                Origin::parse(named).unwrap().text(),
                sent,
                "without the default port, as in browsers"
            );
        }
        assert!(check(&[("origin", "https://plant.example")]) && check(&[("sec-fetch-site", "same-origin")]));
        for origin in ["null", "http://127.0.0.1:9", "https://127.0.0.1:8080", "http://evil.example", ""] {
            assert!(!check(&[("origin", origin)]), "{origin}");
        }
        assert!(!check(&[("sec-fetch-site", "cross-site")]));
    }

    #[test]
    fn the_token_or_a_key_signs_in() {
        let guard = guard();
        let key = guard.sessions.open().unwrap();
        let signed_in = |scheme: &str, secret: &str| {
            guard.is_signed_in(&headers(&[("authorization", &format!("{scheme}{secret}"))]))
        };
        assert!(signed_in("Bearer ", guard.token.digits()) && signed_in("bearer ", &key));
        guard.sessions.close(&key);
        for (scheme, secret) in [
            ("Bearer ", key.as_str()),
            ("Bearer ", ""),
            ("Bearer", ""),
            ("", guard.token.digits()),
            ("Basic ", guard.token.digits()),
        ] {
            assert!(!signed_in(scheme, secret), "{scheme}{secret}");
        }
        let cookie = format!("key={}", guard.token.digits());
        assert!(!guard.is_signed_in(&headers(&[("cookie", &cookie)])));
    }

    #[test]
    fn an_origin_is_a_scheme_and_a_host() {
        assert_eq!(Origin::parse("http://Plant:8080").unwrap().text(), "http://plant:8080");
        for text in [
            "plant",
            "ftp://plant",
            "http://plant/path",
            "http://u@plant",
            "http://plant?x",
            "https://a.b:99999",
            "https://*",
            "",
        ] {
            assert!(Origin::parse(text).is_err(), "{text}");
        }
    }
}
