//! Who may look, and who may give orders.
//!
//! A page of another host could send requests to the address on which this one listens, or give
//! its own name that address (DNS rebinding). So a request must name the host by its address, or as
//! `localhost`: names can be made to mean anything, addresses cannot. Orders must come from a page
//! of that same host, if they come from a page, and must carry the token.

use axum::http::header::{HOST, ORIGIN};
use axum::http::{HeaderMap, Method, Uri};
use std::net::IpAddr;
use subtle::ConstantTimeEq;

/// The header that carries the token.
const TOKEN: &str = "x-gonia-token";

/// Holds the token.
pub struct Guard {
    token: String,
}

/// Why a request is refused, in words for a person.
pub const STRANGE_HOST: &str =
    "name this host by its address, or as localhost: other names are refused\n";
const STRANGE_PAGE: &str = "an order from another page is refused\n";
const NO_TOKEN: &str =
    "this needs the token that gonia capture printed at its start, in the header x-gonia-token\n";

impl Guard {
    /// With 128 random bits from the system.
    ///
    /// # Errors
    /// The system has none.
    pub fn new() -> Result<Self, getrandom::Error> {
        Ok(Self {
            token: random_hex()?,
        })
    }

    /// The token.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// Whether a request may pass; else why not.
    pub fn check(
        &self,
        method: &Method,
        uri: &Uri,
        headers: &HeaderMap,
    ) -> Result<(), &'static str> {
        let host = only(headers, HOST.as_str()).or_else(|| uri.authority().map(|a| a.as_str()));
        let host = host.filter(|host| is_address(host)).ok_or(STRANGE_HOST)?;
        if method == Method::GET || method == Method::HEAD {
            return Ok(());
        }
        if headers.contains_key(ORIGIN) {
            let origin = only(headers, ORIGIN.as_str()).and_then(|o| o.strip_prefix("http://"));
            if origin != Some(host) {
                return Err(STRANGE_PAGE);
            }
        }
        let given = only(headers, TOKEN).unwrap_or_default();
        if bool::from(given.as_bytes().ct_eq(self.token.as_bytes())) {
            Ok(())
        } else {
            Err(NO_TOKEN)
        }
    }
}

/// 32 hexadecimal digits.
pub fn random_hex() -> Result<String, getrandom::Error> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// A header that is there once.
fn only<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let first = values.next()?;
    match values.next() {
        None => first.to_str().ok(),
        Some(_) => None,
    }
}

/// Whether a host is given by its address, with or without a port.
fn is_address(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.split(':').next().unwrap_or_default(),
    };
    name.eq_ignore_ascii_case("localhost") || name.parse::<IpAddr>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::{HeaderName, HeaderValue};

    fn check(guard: &Guard, method: Method, headers: &[(&str, &str)]) -> Result<(), &'static str> {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            let name: HeaderName = name.parse().unwrap();
            map.append(name, HeaderValue::from_str(value).unwrap());
        }
        guard.check(&method, &Uri::from_static("/pause"), &map)
    }

    #[test]
    fn only_this_host_is_shown_anything() {
        let guard = Guard::new().unwrap();
        for host in [
            "127.0.0.1:8080",
            "localhost:1",
            "LOCALHOST",
            "[::1]:80",
            "10.0.0.7",
        ] {
            assert_eq!(
                check(&guard, Method::GET, &[("host", host)]),
                Ok(()),
                "{host}"
            );
        }
        for host in [
            "evil.example",
            "127.0.0.1.evil.example:8080",
            "localhost.evil.example",
            "",
        ] {
            let refused = check(&guard, Method::GET, &[("host", host)]);
            assert_eq!(refused, Err(STRANGE_HOST), "{host}");
        }
        assert_eq!(check(&guard, Method::GET, &[]), Err(STRANGE_HOST));
        let twice = [("host", "127.0.0.1"), ("host", "127.0.0.1")];
        assert_eq!(check(&guard, Method::GET, &twice), Err(STRANGE_HOST));
    }

    #[test]
    fn orders_need_the_token_and_their_own_page() {
        let guard = Guard::new().unwrap();
        let (host, token) = (("host", "127.0.0.1:8080"), ("x-gonia-token", guard.token()));
        let order = |headers: &[(&str, &str)]| check(&guard, Method::POST, headers);
        assert_eq!(order(&[host]), Err(NO_TOKEN));
        assert_eq!(order(&[host, token]), Ok(()));
        assert_eq!(order(&[host, token, token]), Err(NO_TOKEN));
        let wrong = guard.token().replace(|c: char| c.is_ascii_digit(), "z");
        assert_eq!(order(&[host, ("x-gonia-token", &wrong)]), Err(NO_TOKEN));
        assert_eq!(
            order(&[host, ("x-gonia-token", &guard.token()[..31])]),
            Err(NO_TOKEN)
        );
        let own = ("origin", "http://127.0.0.1:8080");
        assert_eq!(order(&[host, token, own]), Ok(()));
        for other in [
            "http://127.0.0.1:8081",
            "https://127.0.0.1:8080",
            "null",
            "http://evil.example",
        ] {
            assert_eq!(
                order(&[host, token, ("origin", other)]),
                Err(STRANGE_PAGE),
                "{other}"
            );
        }
    }

    #[test]
    fn every_start_has_its_own_token() {
        let [a, b] = [(); 2].map(|()| random_hex().unwrap());
        assert!(a.len() == 32 && a != b);
    }
}
