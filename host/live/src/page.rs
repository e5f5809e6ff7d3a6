//! The page itself: one document with its style and its script in it.

/// Of the report, so that both look alike.
const STYLE: &str = include_str!("live.css");
const SCRIPT: &str = include_str!("live.js");
const PAGE: &str = include_str!("live.html");

/// The page. Only the scripts and styles that carry `nonce` may run ([`policy`]).
pub fn page(nonce: &str) -> String {
    PAGE.replace("{nonce}", nonce)
        .replace("{style}", &[gonia_render::svg::STYLE, STYLE].concat())
        .replace("{script}", SCRIPT)
}

/// What a browser may do for the page: nothing beyond this host, nothing that is not in it, and not
/// inside another page.
pub fn policy(nonce: &str) -> String {
    format!(
        "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; \
         img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; \
         frame-ancestors 'none'"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_one_document_that_its_own_policy_lets_run() {
        let text = page("n0");
        assert!(!text.contains("{nonce}") && !text.contains("{style}"));
        assert!(!text.contains("{script}") && text.contains("EventSource"));
        assert_eq!(text.matches("nonce=\"n0\"").count(), 2);
        assert_eq!(
            text.matches("<script").count() + text.matches("<style").count(),
            2
        );
        // Styles and handlers in attributes, and anything from elsewhere, the policy would refuse.
        for refused in [
            " style=",
            " onclick=",
            "http://",
            "https://",
            "@import",
            "url(",
        ] {
            assert!(!text.contains(refused), "{refused}");
        }
        assert!(policy("n0").contains("'nonce-n0'"));
    }
}
