//! Parses XML files in a time bounded by their length.

use roxmltree::{Document, ParsingOptions};

/// Largest size of an XML tag in bytes; the parser compares each attribute with all others of its tag.
const MOST_TAG: usize = 4096;

/// Reason why an XML text cannot be parsed, and the line of the error.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct XmlError {
    /// Line of the XML text where parsing failed, from 1.
    pub line: usize,
    /// Reason why the XML text cannot be parsed.
    pub why: String,
}

/// Parses an XML text of at most `nodes_limit` nodes, without a document type definition.
///
/// # Errors
/// The text is not valid XML, or has a document type definition, too many nodes, or a tag that is too long.
pub fn parse(text: &str, nodes_limit: u32) -> Result<Document<'_>, XmlError> {
    if let Some(at) = long_tag(text.as_bytes()) {
        let line = 1 + text.as_bytes()[..at].iter().filter(|byte| **byte == b'\n').count();
        return Err(XmlError { line, why: format!("a tag of more than {MOST_TAG} bytes") });
    }
    let options = ParsingOptions { allow_dtd: false, nodes_limit, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|e| {
        let line = usize::try_from(e.pos().row).unwrap_or(1);
        XmlError { line, why: e.to_string() }
    })
}

/// Byte offset of the first XML tag that is too long; comments, CDATA and processing instructions do not count.
fn long_tag(bytes: &[u8]) -> Option<usize> {
    let mut at = 0;
    while let Some(found) = bytes[at..].iter().position(|byte| *byte == b'<') {
        let start = at + found;
        let rest = &bytes[start..];
        let ends: &[u8] = match rest {
            [b'<', b'!', b'-', b'-', ..] => b"-->",
            [b'<', b'!', b'[', ..] => b"]]>",
            [b'<', b'?', ..] => b"?>",
            _ => b">",
        };
        let length = rest.windows(ends.len()).position(|window| window == ends)? + ends.len();
        if ends == b">" && length > MOST_TAG {
            return Some(start);
        }
        at = start + length;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_tags_are_refused_but_long_texts_are_not() {
        let attributes: String = (0..2000).map(|i| format!(" a{i}='1'")).collect();
        let error = parse(&format!("<a>\n<b{attributes}/></a>"), 100).unwrap_err();
        assert!(error.line == 2 && error.why.contains("4096"), "{error:?}");
        let long = "x".repeat(10_000);
        for text in [
            format!("<a b='1'>{long}</a>"),
            format!("<a><!-- {long} <b --></a>"),
            format!("<a><![CDATA[{long} <b ]]></a>"),
        ] {
            assert_eq!(parse(&text, 100).unwrap().root_element().tag_name().name(), "a");
        }
        assert!(parse("<a><b/><b/></a>", 2).is_err() && parse("<a", 9).is_err());
    }
}
