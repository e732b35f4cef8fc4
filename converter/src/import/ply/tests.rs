use super::*;

type Mesh = (Vec<DVec3>, Vec<[u8; 3]>, Vec<[u32; 3]>);

/// Positions, colours and triangles of a whole file.
fn read_all(bytes: &[u8]) -> Result<Mesh, ParseError> {
    let soup = parse(bytes)?;
    let (triangles, _) = soup.faces.triangulate(&soup.positions)?;
    Ok((soup.positions, soup.colours, triangles))
}

/// A square with a colour before and an extra list between the coordinates, and an element nobody knows.
fn header(format: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment made for a test\nobj_info none\nelement camera 1\nproperty double fov\n\
         property list ushort short tags\nelement vertex 4\nproperty uchar red\nproperty uchar green\nproperty uint8 blue\n\
         property double z\nproperty list uint8 int8 extra\nproperty float y\nproperty int16 x\n\
         element face 1\nproperty float quality\nproperty list uint uint vertex_index\nend_header\n"
    )
}

fn binary(big_endian: bool) -> Vec<u8> {
    let mut file = header(if big_endian {
        "binary_big_endian"
    } else {
        "binary_little_endian"
    })
    .into_bytes();
    let mut put = |bytes: &[u8]| {
        if big_endian {
            file.extend(bytes.iter().rev());
        } else {
            file.extend(bytes);
        }
    };
    put(&45.0_f64.to_le_bytes());
    put(&2_u16.to_le_bytes());
    put(&(-1_i16).to_le_bytes());
    put(&7_i16.to_le_bytes());
    for (x, y) in [(0_i16, 0.0_f32), (2, 0.0), (2, 0.5), (0, 0.5)] {
        for channel in [10, 20, 30] {
            put(&[channel]);
        }
        put(&0.25_f64.to_le_bytes());
        put(&[1]);
        put(&[0xff]);
        put(&y.to_le_bytes());
        put(&x.to_le_bytes());
    }
    put(&1.5_f32.to_le_bytes());
    put(&4_u32.to_le_bytes());
    for i in 0..4_u32 {
        put(&i.to_le_bytes());
    }
    file
}

#[test]
fn all_encodings_give_the_same_mesh() {
    let text = header("ascii")
        + "45 2 -1 7\n10 20 30 0.25 1 -1 0 0\n10 20 30 0.25 1 -1 0 2\n10 20 30 0.25 1 -1 0.5 2\n\
                                  10 20 30 0.25 1 -1 0.5 0\n1.5 4 0 1 2 3\n";
    let expected = read_all(text.as_bytes()).unwrap();
    assert_eq!(expected.0[2], DVec3::new(2.0, 0.5, 0.25));
    assert_eq!(expected.1, [[10, 20, 30]; 4]);
    assert_eq!(expected.2, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(read_all(&binary(false)).unwrap(), expected);
    assert_eq!(read_all(&binary(true)).unwrap(), expected);
    assert_eq!(
        read_all(text.replace('\n', "\r\n").as_bytes()).unwrap(),
        expected
    );
    assert_eq!(
        read_all(text.replace('\n', "\r").as_bytes()).unwrap(),
        expected
    );
}

#[test]
fn every_cut_of_a_binary_file_is_refused() {
    let file = binary(false);
    let body = header("binary_little_endian").len();
    for end in 4..file.len() {
        let error = parse(&file[..end]).unwrap_err();
        let truncated = matches!(error.fault, Fault::Truncated { .. });
        assert_eq!(truncated, end >= body - 1, "{end}: {error:?}");
    }
}

#[test]
fn strips_alternate_and_restart() {
    let head = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
                element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 2 0\n";
    let (_, _, triangles) =
        read_all(format!("{head}11 0 1 2 3 -1 1 2 4 -1 0 1\n").as_bytes()).unwrap();
    assert_eq!(triangles, [[0, 1, 2], [2, 1, 3], [1, 2, 4]]);
    // A repeated index turns the strip and is no triangle itself.
    let (_, _, triangles) = read_all(format!("{head}5 0 1 2 2 3\n").as_bytes()).unwrap();
    assert_eq!(triangles, [[0, 1, 2]]);
    assert!(parse(format!("{head}4 0 1 2 -2\n").as_bytes()).is_err());
}

#[test]
fn float_colours_and_diffuse_names_are_known() {
    let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                property float diffuse_red\nproperty float diffuse_green\nproperty float diffuse_blue\nend_header\n0 0 0 1 0.5 0\n";
    assert_eq!(parse(text.as_bytes()).unwrap().colours, [[255, 128, 0]]);
}

#[test]
fn counts_are_bounded_before_memory_is_taken() {
    for count in ["4000000000", "18446744073709551615"] {
        for format in ["ascii", "binary_little_endian"] {
            let text = format!(
                "ply\nformat {format} 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
                 element face {count}\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n"
            );
            let error = parse(text.as_bytes()).unwrap_err();
            assert!(error.fault.to_string().contains(count), "{}", error.fault);
        }
    }
    let list = "ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list double double vertex_indices\nend_header\n";
    for length in [1e18, -1.0, 0.5, f64::NAN, f64::INFINITY] {
        let mut file = list.as_bytes().to_vec();
        file.extend(length.to_le_bytes());
        assert!(parse(&file).is_err(), "{length}");
    }
}

#[test]
fn faults_name_their_place() {
    let body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let good = format!("{head}{body}");
    assert!(read_all(good.as_bytes()).is_ok());
    for (from, to, place, part) in [
        ("1 0 0\n", "1 zero 0\n", Place::Line(11), "zero"),
        (
            "3 0 1 2",
            "3 0 1 3",
            Place::Line(13),
            "vertex 3, but there are 3",
        ),
        ("3 0 1 2", "3 0 -1 2", Place::Line(13), "vertex -1"),
        ("3 0 1 2", "3 0 1.5 2", Place::Line(13), "1.5"),
        ("3 0 1 2\n", "3 0 1\n", Place::Line(14), "ends early"),
        (
            "3 0 1 2\n",
            "3 0 1 2 9\n",
            Place::Line(13),
            "follows the last element",
        ),
        (
            "property float z",
            "property half z",
            Place::Line(6),
            "half",
        ),
        ("format ascii", "format utf8", Place::Line(2), "utf8"),
        ("format ascii 1.0\n", "", Place::File, "no line format"),
        ("property float z\n", "", Place::File, "x, y and z"),
        ("end_header\n", "", Place::Line(9), "unknown keyword"),
        ("list uchar int", "int", Place::File, "no list"),
        (
            "element vertex 3",
            "element points 3",
            Place::File,
            "no element vertex",
        ),
    ] {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good);
        let error = read_all(text.as_bytes()).unwrap_err();
        let message = error.fault.to_string();
        assert!(message.contains(part), "{to:?}: {message}");
        assert_eq!(error.place, place, "{to:?}: {message}");
    }
}

/// A file of `count` vertices and faces with more properties than needed; `number` writes one value.
fn regular(
    format: &str,
    count: u32,
    mut record: impl FnMut(&mut Vec<u8>, &[(char, f64)]),
) -> Vec<u8> {
    let mut file = format!(
        "ply\nformat {format} 1.0\nelement vertex {count}\nproperty float x\nproperty double y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nelement face {count}\nproperty short flags\n\
         property list uchar int vertex_indices\nproperty list uchar float texcoord\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
    )
    .into_bytes();
    for i in 0..count {
        let c = f64::from(i % 256);
        record(
            &mut file,
            &[
                ('f', 0.5 * c),
                ('d', -c),
                ('f', 3.0),
                ('b', c),
                ('b', 7.0),
                ('b', 255.0 - c),
            ],
        );
    }
    for i in 0..count {
        let corner = |k: u32| ('i', f64::from((i + k) % count));
        record(
            &mut file,
            &[
                ('s', -3.0),
                ('b', 3.0),
                corner(0),
                corner(1),
                corner(2),
                ('b', 2.0),
                ('f', 0.25),
                ('f', 0.75),
                ('b', f64::from(i % 256)),
                ('b', 5.0),
                ('b', 0.0),
            ],
        );
    }
    file
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small integers"
)]
fn put_binary<const BIG_ENDIAN: bool>(file: &mut Vec<u8>, values: &[(char, f64)]) {
    for &(kind, value) in values {
        let mut bytes = match kind {
            'b' => vec![value as u8],
            's' => (value as i16).to_le_bytes().to_vec(),
            'i' => (value as i32).to_le_bytes().to_vec(),
            'f' => (value as f32).to_le_bytes().to_vec(),
            _ => value.to_le_bytes().to_vec(),
        };
        if BIG_ENDIAN {
            bytes.reverse();
        }
        file.extend(bytes);
    }
}

fn put_text(file: &mut Vec<u8>, values: &[(char, f64)]) {
    let words: Vec<String> = values.iter().map(|(_, v)| v.to_string()).collect();
    file.extend(words.join(" ").bytes());
    file.push(b'\n');
}

/// Reading in parallel and value by value give the same, faults included.
fn assert_bulk_is_the_same(bytes: &[u8]) {
    let read = |bulk| {
        let soup = parse_from(bytes, bulk)?;
        let (triangles, _) = soup.faces.triangulate(&soup.positions)?;
        let bits: Vec<_> = soup
            .positions
            .iter()
            .map(|p| p.to_array().map(f64::to_bits))
            .collect();
        Ok::<_, ParseError>((bits, soup.colours, triangles, soup.face_colours))
    };
    assert_eq!(read(0), read(u64::MAX));
}

#[test]
fn bulk_reading_takes_regular_files() {
    for bytes in [
        regular("ascii", 300, put_text),
        regular("binary_little_endian", 300, put_binary::<false>),
        regular("binary_big_endian", 300, put_binary::<true>),
    ] {
        assert_bulk_is_the_same(&bytes);
        let soup = parse_from(&bytes, 0).unwrap();
        assert_eq!(
            (soup.positions.len(), soup.colours.len(), soup.faces.len()),
            (300, 300, 300)
        );
        assert_eq!(soup.positions[299], DVec3::new(21.5, -43.0, 3.0));
        assert_eq!(soup.face_colours.len(), 300);
        assert_eq!(soup.face_colours[299], Some([43, 5, 0]));
    }
}

#[test]
fn bulk_reading_leaves_irregular_files_alone() {
    let text = String::from_utf8(regular("ascii", 40, put_text)).unwrap();
    let body = text.find("end_header\n").unwrap() + "end_header\n".len();
    for (from, to) in [
        ("-3 3 1 2 3 ", "-3 4 1 2 3 0 "),
        ("-3 3 1 2 3 ", "-3 2 1 2 "),
        ("-3 3 1 2 3 ", "-3 3 1 2 99 "),
        ("-3 3 1 2 3 ", "-3 3 1 2 -1 "),
        ("-3 3 1 2 3 ", "-3 3 1\n2 3 "),
        ("-3 3 1 2 3 ", "\n-3 3 1 2 3 "),
        ("-3 3 1 2 3 ", "-3 3 1 two 3 "),
        ("-3 3 1 2 3 ", ""),
        ("-20 3 ", "-20 nan "),
        ("\n", "\r\n"),
        ("\n", " "),
    ] {
        let changed = format!("{}{}", &text[..body], text[body..].replace(from, to));
        assert_ne!(changed, text);
        assert_bulk_is_the_same(changed.as_bytes());
    }
    for end in body..text.len() {
        assert_bulk_is_the_same(&text.as_bytes()[..end]);
    }
    let binary = regular("binary_little_endian", 5, put_binary::<false>);
    let body = binary.len() - 5 * (23 + 28);
    for at in body..binary.len() {
        for value in [0, 1, 4, 255] {
            let mut changed = binary.clone();
            changed[at] = value;
            assert_bulk_is_the_same(&changed);
        }
        assert_bulk_is_the_same(&binary[..at]);
    }
}
