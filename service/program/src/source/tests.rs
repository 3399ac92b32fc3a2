use super::*;

fn place(offset: u64) -> Place {
    Place { program: 0, offset }
}

/// Everything that windows give from `from` on, supplied by a host that gives `piece` bytes at a time.
fn read_all(pages: &mut SourcePages, program: &[u8], from: u64, piece: usize) -> Vec<u8> {
    let mut read = Vec::new();
    loop {
        let at = place(from + read.len() as u64);
        match pages.window(at) {
            Some(Window { bytes: [], ends }) => {
                assert!(ends);
                return read;
            }
            Some(window) => read.extend_from_slice(window.bytes),
            None => match &program[pages.wanted().offset as usize..] {
                [] => pages.finish(),
                rest => pages.push(&rest[..piece.min(rest.len())]),
            },
        }
    }
}

fn program(length: usize) -> Vec<u8> {
    (0..length).map(|index| (index % 251) as u8).collect()
}

#[test]
fn a_program_is_read_from_any_place_in_pieces_of_any_size() {
    let program = program(300_000);
    for (piece, from) in [(1_000, 0), (70_000, 17), (usize::MAX, 0), (65_536, 65_535), (65_537, 299_999)] {
        let mut pages = SourcePages::from(place(from));
        assert_eq!(read_all(&mut pages, &program, from, piece), program[from as usize..], "{piece}, {from}");
        for again in [0, from, 65_536, 200_000] {
            assert_eq!(read_all(&mut pages, &program, again, piece), program[again as usize..], "{again}");
        }
    }
}

#[test]
fn what_was_read_is_kept_and_bounded() {
    let program = program(10_000_000);
    let mut pages = SourcePages::from(place(0));
    read_all(&mut pages, &program, 0, 65_536);
    assert!(pages.pages.len() <= MAX_READ_PAGES + 2, "{}", pages.pages.len());
    assert!(pages.window(place(9_990_000)).is_some(), "at hand");
    assert!(pages.window(place(100_001)).is_none(), "no longer");
    assert_eq!(pages.wanted(), place(65_536), "the whole page");
}

#[test]
fn pages_that_were_never_read_are_not_given_up() {
    let program = program(5_000_000);
    let mut pages = SourcePages::from(place(0));
    pages.push(&program);
    pages.finish();
    let mut read = 0;
    while let Some(Window { bytes, ends }) = pages.window(place(read)) {
        read += bytes.len() as u64;
        if ends {
            break;
        }
    }
    assert_eq!(read, 5_000_000);
}

#[test]
fn programs_are_apart() {
    let mut pages = SourcePages::from(place(0));
    pages.push(b"first");
    pages.finish();
    let second = Place { program: 1, offset: 0 };
    assert!(pages.window(second).is_none());
    assert_eq!(pages.wanted(), second);
    pages.push(b"second");
    pages.finish();
    assert_eq!(pages.window(second).map(|window| (window.bytes, window.ends)), Some((&b"second"[..], true)));
    assert_eq!(pages.window(place(0)).map(|window| (window.bytes, window.ends)), Some((&b"first"[..], true)));
}
