//! From bytes to JSON and buffers.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use gltf::json::deserialize::from_slice;
use gltf::json::{Buffer, Error};

use super::json::{Head, Root};

/// The contents of a buffer; an error becomes one of the file only where the buffer is used.
type Data<'a> = Result<Arc<Cow<'a, [u8]>>, String>;

/// What a buffer view unpacks to, or `None` if it is not compressed.
type Unpacked = Option<Result<Vec<u8>, String>>;

/// A file with the buffers that it refers to.
pub(super) struct Container<'a> {
    pub root: Root,
    pub buffers: Vec<Data<'a>>,
    /// For each buffer view, once it is used.
    pub unpacked: Vec<OnceLock<Unpacked>>,
    /// The bytes of a file next to it.
    pub external: &'a dyn Fn(&str) -> Result<Vec<u8>, String>,
}

impl<'a> Container<'a> {
    /// Reads a `.gltf` or `.glb` file; `external` returns the bytes of a file next to it.
    pub fn open(
        bytes: &'a [u8],
        external: &'a dyn Fn(&str) -> Result<Vec<u8>, String>,
    ) -> Result<Self, String> {
        let (json, blob) = if bytes.starts_with(b"glTF") { split(bytes)? } else { (bytes, None) };
        let head: Head = from_slice(json).map_err(|error| explain(&error))?;
        if !head.asset.version.starts_with("2.") {
            return Err(format!(
                "it is glTF {}, but only glTF 2.0 is read: convert it, for example with `npx gltf-pipeline`",
                head.asset.version
            ));
        }
        if let Some(version) = head.asset.min_version.filter(|version| version != "2.0") {
            return Err(format!("it needs glTF {version}, but only glTF 2.0 is read"));
        }
        let root: Root = from_slice(json).map_err(|error| explain(&error))?;
        // Each file once, however many buffers it has.
        let mut files: HashMap<String, Data> = HashMap::new();
        let mut read = |(index, buffer): (usize, &Buffer)| {
            let data = match buffer.uri.as_deref() {
                None if index == 0 => blob.map(|blob| Arc::new(Cow::Borrowed(blob))).ok_or_else(|| {
                    "the binary chunk of its buffer is missing: the file is truncated or damaged".into()
                }),
                None => Err(format!("buffer {index} has no data")),
                Some(uri) => match uri.strip_prefix("data:") {
                    Some(data) => decode_data(data).map(|data| Arc::new(Cow::Owned(data))),
                    None => files
                        .entry(decode_percent(uri))
                        .or_insert_with_key(|name| Ok(Arc::new(Cow::Owned(external(name)?))))
                        .clone(),
                },
            }?;
            let (length, promised) = (data.len(), buffer.byte_length.0);
            if (length as u64) < promised {
                return Err(format!(
                    "buffer {index} has {length} bytes instead of {promised}: the file is truncated or damaged"
                ));
            }
            Ok(data)
        };
        let buffers = root.buffers.iter().enumerate().map(&mut read).collect();
        let unpacked = root.buffer_views.iter().map(|_| OnceLock::new()).collect();
        Ok(Self { root, buffers, unpacked, external })
    }
}

/// A JSON error in a sentence.
fn explain(error: &Error) -> String {
    if error.is_eof() {
        format!("its JSON ends too early ({error}): the file is truncated or damaged")
    } else if error.is_syntax() {
        format!("its JSON is damaged: {error}")
    } else {
        format!("its JSON is not that of a glTF file: {error}")
    }
}

/// The JSON and the binary chunk of a GLB file. Chunks of other kinds are skipped, as the specification demands.
fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    check_header(bytes)?;
    let mut rest = &bytes[12..];
    let (mut json, mut blob) = (None, None);
    while let Some((head, data)) = rest.split_first_chunk::<8>() {
        let [a, b, c, d, kind @ ..] = *head;
        let length = u32::from_le_bytes([a, b, c, d]) as usize;
        let (chunk, next) = data.split_at_checked(length).ok_or_else(|| {
            format!("a chunk has {} bytes instead of {length}: the file is truncated", data.len())
        })?;
        match &kind {
            b"JSON" if json.is_none() => json = Some(chunk),
            b"BIN\0" if blob.is_none() => blob = Some(chunk),
            _ => {}
        }
        rest = next;
    }
    Ok((json.ok_or("it has no JSON chunk: the file is truncated or damaged")?, blob))
}

/// A GLB header contains the file's length. Truncation is the most common damage, so it gets its own message.
fn check_header(bytes: &[u8]) -> Result<(), String> {
    let Some(&[_, _, _, _, a, b, c, d, e, f, g, h]) = bytes.first_chunk::<12>() else {
        return Err("it ends inside its header: truncated".to_owned());
    };
    let (version, length) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]) as usize);
    if !(12..=bytes.len()).contains(&length) {
        return Err(format!("it has {} bytes instead of the {length} of its header: truncated", bytes.len()));
    }
    if version != 2 {
        return Err(format!(
            "it is a GLB file of version {version}, but only version 2 is read: convert it, for example with \
             `npx gltf-pipeline`"
        ));
    }
    Ok(())
}

/// The bytes of a data URI after `data:`.
pub(super) fn decode_data(data: &str) -> Result<Vec<u8>, String> {
    let (_, text) = data.split_once(";base64,").ok_or("a data URI is not in base64")?;
    decode_base64(text)
}

/// Standard base64 (RFC 4648 section 4), padded or not.
fn decode_base64(text: &str) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0_u32, 0);
    for c in text.trim_end_matches('=').bytes() {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return Err(format!("`{}` is not base64", char::from(c).escape_default())),
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    Ok(bytes)
}

/// Decodes percent-encoded characters, such as `%20`, in a file name of a URI.
pub(super) fn decode_percent(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        let code = tail.get(..2).and_then(|hex| u8::from_str_radix(std::str::from_utf8(hex).ok()?, 16).ok());
        match (first, code) {
            (b'%', Some(byte)) => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            _ => {
                bytes.push(first);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A GLB file of chunks.
    fn glb(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let chunk = |(kind, data): &(&[u8; 4], &[u8])| {
            [&(data.len() as u32).to_le_bytes()[..], &kind[..], data].concat()
        };
        let chunks: Vec<u8> = chunks.iter().flat_map(chunk).collect();
        let length = 12 + chunks.len() as u32;
        [&b"glTF"[..], &2_u32.to_le_bytes(), &length.to_le_bytes(), &chunks].concat()
    }

    #[test]
    fn a_file_that_is_shorter_than_its_header_says_is_truncated() {
        let whole = glb(&[(b"JSON", b"{}")]);
        // What follows the promised length does not count. Twelve bytes are a header without anything.
        for (promised, fits) in
            [(whole.len() - 1, true), (12, true), (11, false), (0, false), (whole.len() + 1, false)]
        {
            let mut file = whole.clone();
            file[8..12].copy_from_slice(&(promised as u32).to_le_bytes());
            let said = check_header(&file);
            let expected =
                format!("it has {} bytes instead of the {promised} of its header: truncated", whole.len());
            assert_eq!(said, if fits { Ok(()) } else { Err(expected) });
        }
        let said = check_header(&whole[..11]).unwrap_err();
        assert_eq!(said, "it ends inside its header: truncated");
    }

    #[test]
    fn chunks_of_other_kinds_are_skipped() {
        let file = glb(&[(b"what", b"1234"), (b"JSON", b"{ }"), (b"else", b""), (b"BIN\0", b"abcd")]);
        assert_eq!(split(&file), Ok((&b"{ }"[..], Some(&b"abcd"[..]))));
        assert_eq!(split(&glb(&[(b"JSON", b"{}")])), Ok((&b"{}"[..], None)));
        let message = split(&glb(&[(b"BIN\0", b"abcd")])).unwrap_err();
        assert_eq!(message, "it has no JSON chunk: the file is truncated or damaged");
        let mut file = glb(&[(b"JSON", b"{}  ")]);
        file[12] = 5;
        assert_eq!(split(&file).unwrap_err(), "a chunk has 4 bytes instead of 5: the file is truncated");
    }

    #[test]
    fn what_is_not_gltf_2_is_named() {
        let open = |bytes: &[u8]| Container::open(bytes, &|_| Err(String::new())).map(|_| ()).unwrap_err();
        let mut old = glb(&[(b"JSON", b"{}")]);
        old[4] = 1;
        for (bytes, expected) in [
            (&old[..], "it is a GLB file of version 1, but only version 2 is read: convert it"),
            (br#"{"asset": {"version": "1.0"}, "buffers": {}}"#, "it is glTF 1.0, but only glTF 2.0 is read"),
            (br#"{"asset": {"version": "2.1", "minVersion": "2.1"}}"#, "it needs glTF 2.1"),
            (br#"{"asset": {"version": "2.0"}, "nodes": ["#, "its JSON ends too early (EOF"),
            (br#"{"asset": {"version": "2.0"}, "nodes": [}"#, "its JSON is damaged: expected value"),
            (
                br#"{"asset": {"version": "2.0"}, "nodes": 7}"#,
                "its JSON is not that of a glTF file: invalid type",
            ),
            (b"{}", "its JSON is not that of a glTF file: missing field `asset`"),
        ] {
            let message = open(bytes);
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn base64_has_64_digits_and_any_padding() {
        // RFC 4648, section 10.
        for (text, bytes) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg==", "foob"),
            ("Zm9vYmE=", "fooba"),
            ("Zm9vYmFy", "foobar"),
        ] {
            assert_eq!(decode_base64(text).unwrap(), bytes.as_bytes());
            assert_eq!(decode_base64(text.trim_end_matches('=')).unwrap(), bytes.as_bytes());
        }
        // All digits in their order: the numbers from 0 to 63, six bits each.
        let digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let bits = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:08b}")).collect::<String>();
        let expected: String = (0..64).map(|number| format!("{number:06b}")).collect();
        assert_eq!(bits(&decode_base64(digits).unwrap()), expected);
        for wrong in ["TW?u", "TW-u", "TW_u", "T=Wu", "TW u", "TW@u", "TW[u", "TW`u", "TW{u", "TW:u", "TW.u"]
        {
            assert!(decode_base64(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn percent_signs_encode_bytes_of_file_names() {
        for (uri, name) in [
            ("plain.bin", "plain.bin"),
            ("a%20b.bin", "a b.bin"),
            ("%C3%A9t%c3%a9", "\u{e9}t\u{e9}"),
            ("100%", "100%"),
            ("5%2", "5%2"),
            ("%zz%41", "%zzA"),
        ] {
            assert_eq!(decode_percent(uri), name);
        }
    }
}
