//! Watching for the first bad number: what a run with [`Settings::watch`](crate::Settings::watch) reports, and the
//! checks of a stage's own.

use std::{
    fmt,
    sync::{Mutex, PoisonError},
};

use crate::{port::FieldRef, side::Side, values::Wrong};

/// The first bad value that a node wrote in a frame, in the order of execution. Among the values of a node, checks of
/// its own come first, then its ports in the order of their declaration; in a port the first element counts.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct BadValue {
    /// The node.
    pub node: String,
    /// Its stage kind.
    pub kind: String,
    /// The port, `node.port`, or `node.port.field` for a bundle.
    pub port: String,
    /// The index of the element, row by row.
    pub element: usize,
    /// Which number of the element, such as `position.x` or `g`; empty if it has only one, or if a check failed.
    pub number: String,
    /// The pixel, if the port has one element for each pixel of the frame, or for each corner of one.
    pub pixel: Option<[u32; 2]>,
    /// [`Frame::index`](crate::Frame::index).
    pub frame: u32,
    /// Where the node runs.
    #[serde(serialize_with = "as_text")]
    pub side: Side,
    /// What is wrong.
    pub wrong: Wrong,
    /// The number as text; if a check failed, all numbers of the element.
    pub value: String,
    /// What is allowed, or the text of the check.
    pub expected: String,
    /// The ports that the node read, none of which held a bad value.
    pub read: Vec<String>,
}

fn as_text<S: serde::Serializer>(side: &Side, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(side)
}

impl fmt::Display for BadValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { node, kind, port, element, number, frame, side, value, expected, read, .. } = self;
        let what =
            if self.wrong == Wrong::Check { "fails a check of its own" } else { "writes a bad number" };
        write!(f, "node `{node}` ({kind}, on the {side}) {what} in frame {frame}: `{port}`, ")?;
        if let Some([x, y]) = self.pixel {
            write!(f, "pixel ({x}, {y}), ")?;
        }
        write!(f, "element {element}")?;
        if !number.is_empty() {
            write!(f, ", {number}")?;
        }
        match self.wrong {
            Wrong::Check => write!(f, ": {expected}; the element is {value}")?,
            _ => write!(f, ": {value}, but allowed are {expected}")?,
        }
        match &read[..] {
            [] => write!(f, ". It reads nothing"),
            read => write!(f, ". Nothing that it read is bad: {}", read.join(", ")),
        }
    }
}

/// A failed check: the port, the element, and what does not hold.
pub(crate) type FailedCheck = (FieldRef, usize, &'static str);

/// The checks that failed while a twin ran.
#[derive(Debug, Default)]
pub(crate) struct Failed(Mutex<Option<FailedCheck>>);

impl Failed {
    /// The first failed check since the last call: of the first port, and of its first element.
    pub fn take(&self) -> Option<FailedCheck> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Takes the results of a twin's own checks of one port: see [`CpuContext::checks`](crate::CpuContext::checks). Several
/// threads may use it.
#[derive(Clone, Copy, Debug)]
pub struct Checks<'a> {
    failed: &'a Failed,
    port: FieldRef,
}

impl<'a> Checks<'a> {
    pub(crate) fn new(failed: &'a Failed, port: FieldRef) -> Self {
        Self { failed, port }
    }

    /// Reports an element for which something does not hold; `text` says what should.
    pub fn that(&self, element: usize, holds: bool, text: &'static str) {
        if holds {
            return;
        }
        let mut first = self.failed.0.lock().unwrap_or_else(PoisonError::into_inner);
        let order = |(FieldRef { port, field }, element, text): FailedCheck| (port, field, element, text);
        let new = (self.port, element, text);
        if first.is_none_or(|first| order(new) < order(first)) {
            *first = Some(new);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bad() -> BadValue {
        BadValue {
            node: "fill".into(),
            kind: "fill".into(),
            port: "fill.color".into(),
            element: 460,
            number: "g".into(),
            pixel: Some([12, 7]),
            frame: 3,
            side: Side::Gpu,
            wrong: Wrong::Nan,
            value: "NaN".into(),
            expected: "finite numbers from 0".into(),
            read: vec!["cloud.cloud".into(), "cull.id".into()],
        }
    }

    #[test]
    fn the_message_has_everything() {
        let expected = "node `fill` (fill, on the gpu) writes a bad number in frame 3: `fill.color`, pixel (12, 7), \
                        element 460, g: NaN, but allowed are finite numbers from 0. Nothing that it read is bad: \
                        cloud.cloud, cull.id";
        assert_eq!(bad().to_string(), expected);
        let check = BadValue {
            wrong: Wrong::Check,
            number: String::new(),
            pixel: None,
            value: "0.5, 2.0".into(),
            expected: "the sum is 1".into(),
            read: Vec::new(),
            ..bad()
        };
        let expected = "node `fill` (fill, on the gpu) fails a check of its own in frame 3: `fill.color`, element 460: \
                        the sum is 1; the element is 0.5, 2.0. It reads nothing";
        assert_eq!(check.to_string(), expected);
    }

    #[test]
    fn the_first_failed_check_counts_whatever_the_order() {
        let failed = Failed::default();
        let [first, second] = [0, 1].map(|port| Checks::new(&failed, FieldRef { port, field: 0 }));
        assert_eq!(failed.take(), None);
        second.that(3, false, "b");
        first.that(7, false, "a");
        first.that(5, true, "a");
        first.that(9, false, "a");
        assert_eq!(failed.take(), Some((FieldRef { port: 0, field: 0 }, 7, "a")));
        assert_eq!(failed.take(), None);
    }
}
