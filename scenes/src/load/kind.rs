//! What a file is, by its first bytes.

/// The kinds of mesh file that are read, as their contents show.
const MESHES: [(&[u8], &str, &[&str]); 2] =
    [(b"glTF", "a binary glTF file", &[".glb", ".gltf"]), (b"ply", "a PLY file", &[".ply", ".ply.gz"])];

/// Kinds of file that people have under a mesh's or a scene's name: how they begin, what they are, and what to do.
const OTHERS: [(&[u8], &str, &str); 21] = [
    (
        b"version https://git-lfs",
        "a git-lfs pointer, which stands for a file that is elsewhere",
        "run `git lfs pull` in its repository",
    ),
    (b"PK\x03\x04", "a zip archive", UNPACK),
    (b"7z\xBC\xAF\x27\x1C", "a 7z archive", UNPACK),
    (b"Rar!", "a RAR archive", UNPACK),
    (b"\xFD7zXZ\0", "compressed by xz", UNPACK),
    (b"BZh", "compressed by bzip2", UNPACK),
    (b"\x28\xB5\x2F\xFD", "compressed by zstd", UNPACK),
    (b"Kaydara FBX Binary", "an FBX file", EXPORT),
    (b"; FBX", "an FBX file", EXPORT),
    (b"BLENDER", "a Blender file", EXPORT),
    (b"PXR-USDC", "a USD file", EXPORT),
    (b"#usda", "a USD file", EXPORT),
    (b"solid ", "an STL file", EXPORT),
    (b"ISO-10303-21", "a STEP file", EXPORT),
    (b"OFF", "an OFF file", EXPORT),
    (b"DRACO", "a mesh compressed by Draco alone", EXPORT),
    (b"\x89PNG", "a PNG picture", NO_MESH),
    (b"\xFF\xD8\xFF", "a JPEG picture", NO_MESH),
    (b"%PDF", "a PDF document", NO_MESH),
    (b"LASF", "a LAS file, points without surfaces", "`epigraph encode` makes a point set of it"),
    (b"\x7FELF", "a program", NO_MESH),
];
const UNPACK: &str = "unpack it first";
const EXPORT: &str = "export it as .glb from the program that made it, or convert it";
const NO_MESH: &str = "name a file with a mesh";

/// Texts that are served in the place of a file: in lower case, how they begin, what they are, and what to do.
const ANSWERS: [(&str, &str, &str); 4] = [
    ("404: not found", "the answer of a server that has no such file", "download it from its right address"),
    ("<!doctype html", PAGE, DOWNLOAD),
    ("<html", PAGE, DOWNLOAD),
    ("<?xml", "an XML document (COLLADA, X3D, ...)", EXPORT),
];
const PAGE: &str = "a web page (HTML), as servers send it instead of a file";
const DOWNLOAD: &str = "download the file itself (\"raw\")";

/// Refuses a file that is of another kind than its `name`, in lower case, says.
///
/// # Errors
/// What it is and what to do.
pub(super) fn check(bytes: &[u8], name: &str) -> Result<(), String> {
    let refuse = |what: &str, advice: &str| Err(format!("it is {what}: {advice}"));
    if bytes.is_empty() {
        return Err("it is empty: copy or download it again".to_owned());
    }
    let start = &bytes[..bytes.len().min(4096)];
    if bytes.len() > 16 && start.iter().all(|&byte| byte == 0) {
        return Err("it is not what its name says: it begins with zeros, as after a copy that was not \
             finished; copy or download it again"
            .to_owned());
    }
    if let Some((_, what, endings)) = MESHES.iter().find(|(magic, _, endings)| {
        start
            .strip_prefix(*magic)
            .is_some_and(|rest| rest.first().is_none_or(|next| !next.is_ascii_alphabetic()))
            && !endings.iter().any(|ending| name.ends_with(ending))
    }) {
        return refuse(what, &format!("rename it to end in {}", endings[0]));
    }
    if let Some((_, what, advice)) = OTHERS.iter().find(|(magic, ..)| start.starts_with(magic)) {
        return refuse(what, advice);
    }
    let text = epigraph_files::without_mark(start).trim_ascii_start();
    let text = String::from_utf8_lossy(&text[..text.len().min(32)]).to_lowercase();
    match ANSWERS.iter().find(|(start, ..)| text.starts_with(start)) {
        Some((_, what, advice)) => refuse(what, advice),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_other_kinds_are_called_what_they_are() {
        let zeros = [0; 100];
        let [page, later] = [4096, 4095].map(|count| [&vec![0; count][..], b"1"].concat());
        for (bytes, expected) in [
            (&b""[..], "it is empty"),
            (&zeros, "begins with zeros"),
            (&zeros[..17], "begins with zeros"),
            (&page, "begins with zeros"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n", "run `git lfs pull`"),
            (b"\n  <!DOCTYPE html>\n<title>", "a web page (HTML)"),
            (b"\xEF\xBB\xBF<HTML>", "download the file itself"),
            (b"404: Not Found", "the answer of a server"),
            (b"<?xml version=\"1.0\"?><COLLADA>", "an XML document"),
            (b"PK\x03\x04....", "a zip archive: unpack it first"),
            (b"Kaydara FBX Binary  \0", "an FBX file: export it as .glb"),
            (b"\x89PNG\r\n", "a PNG picture"),
            (b"LASF\0\0", "`epigraph encode` makes a point set"),
        ] {
            for name in ["a.obj", "a.ply", "a.glb", "a.gltf", "a.ron"] {
                let error = check(bytes, name).unwrap_err();
                assert!(error.contains(expected), "{name}: {error}");
            }
        }
        assert_eq!(
            check(b"glTF\x02\0\0\0", "a.obj").unwrap_err(),
            "it is a binary glTF file: rename it to end in .glb"
        );
        assert_eq!(
            check(b"ply\r\nformat", "a.glb").unwrap_err(),
            "it is a PLY file: rename it to end in .ply"
        );
        for (bytes, name) in [
            (&b"glTF\x02\0\0\0"[..], "a.glb"),
            (b"glTF\x02\0\0\0", "a.gltf"),
            (b"ply\n", "a.ply"),
            (b"ply", "a.ply.gz"),
            (b"plywood 1\nv 0 0 0", "a.obj"),
            (b"{\"asset\"", "a.gltf"),
            (b"# solid\nv 0 0 0", "a.obj"),
            (b"Scene(version: 1)", "a.ron"),
            // Too short to be what is left of a copy.
            (&[0; 16], "a.obj"),
            // A page of zeros with one number in it.
            (&later, "a.obj"),
        ] {
            assert_eq!(check(bytes, name), Ok(()));
        }
    }
}
