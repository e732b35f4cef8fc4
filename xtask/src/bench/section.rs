//! The part of a document that a program writes.

use anyhow::{Result, bail};

const BEGIN: &str = "<!-- bench: written by `cargo xtask bench` -->";
const END: &str = "<!-- bench: end -->";

/// `document` with `text` between its marks; all else stays as it is. Without marks they are put at its end.
///
/// # Errors
/// When there is one mark without the other, or more than one pair.
pub(super) fn replaced(document: &str, text: &str) -> Result<String> {
    let text = text.trim();
    let places = |mark| document.match_indices(mark).map(|(at, _)| at).collect();
    let (begins, ends): (Vec<usize>, Vec<usize>) = (places(BEGIN), places(END));
    match (begins.as_slice(), ends.as_slice()) {
        ([], []) => Ok(format!(
            "{}\n\n{BEGIN}\n\n{text}\n\n{END}\n",
            document.trim_end()
        )),
        (&[begin], &[end]) if begin < end => {
            let (before, after) = (&document[..begin], &document[end..]);
            Ok(format!("{before}{BEGIN}\n\n{text}\n\n{after}"))
        }
        _ => bail!("the marks `{BEGIN}` and `{END}` must be there once each, in this order"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_between_the_marks_changes() {
        let first = replaced("# By hand\n\nWords.\n", "one").unwrap();
        assert_eq!(
            first,
            format!("# By hand\n\nWords.\n\n{BEGIN}\n\none\n\n{END}\n")
        );
        let document = format!("{first}\n## More by hand\n");
        let second = replaced(&document, "two\n\n| a |\n").unwrap();
        assert_eq!(second, document.replace("one", "two\n\n| a |"));
        assert_eq!(replaced(&second, "one").unwrap(), document);
    }

    #[test]
    fn half_a_pair_of_marks_is_refused() {
        for document in [
            BEGIN.to_owned(),
            END.to_owned(),
            format!("{END}\n{BEGIN}"),
            format!("{BEGIN}{END}{BEGIN}{END}"),
        ] {
            assert!(replaced(&document, "text").is_err(), "{document}");
        }
    }
}
