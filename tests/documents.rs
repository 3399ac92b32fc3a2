//! What comments and documents cite is there: every page, every section of a page, every file that a link names.

use std::fs;
use std::path::{Path, PathBuf};

const REPOSITORY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Where text is written that may cite a page.
const FOLDERS: [&str; 10] =
    ["service", "proto", "clients", "tests", "migrations", "deploy", "fuzz", "docs", "editors", ".ci"];

/// The page that is about a machining function, by the folder of the function.
const PAGES: [(&str, &str); 5] = [
    ("path_vibration", "docs/functions/path-vibration.md"),
    ("five_axis", "docs/functions/five-axis-thinning.md"),
    ("thinning", "docs/functions/five-axis-thinning.md"),
    ("thread", "docs/functions/thread-vibration.md"),
    ("tool_oscillation", "docs/functions/tool-oscillation.md"),
];

/// Sources that are not in the repository, in the words by which they were once cited.
const ELSEWHERE: [&str; 5] = ["specification page", "vibration page", "oscillation page", "(page 0", "of page 0"];

/// A page or file that a text names, with the section if one is named.
#[derive(Debug, PartialEq)]
struct Citation {
    path: String,
    sections: Vec<String>,
}

/// All text files of the repository that people write, as paths below it.
fn texts() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders: Vec<PathBuf> = FOLDERS.iter().map(PathBuf::from).collect();
    folders.push(PathBuf::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(Path::new(REPOSITORY).join(&folder)).expect("a folder of the repository") {
            let entry = entry.expect("an entry");
            let path = folder.join(entry.file_name());
            let is_folder = entry.file_type().expect("a type").is_dir();
            if is_folder && !folder.as_os_str().is_empty() && entry.file_name() != "target" {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| {
                ["rs", "proto", "sql", "toml", "md", "sh", "py", "yaml"].iter().any(|known| extension == *known)
            }) {
                found.push(path);
            }
        }
    }
    assert!(found.len() > 100, "{} files", found.len());
    found
}

fn read(path: &Path) -> String {
    fs::read_to_string(Path::new(REPOSITORY).join(path)).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The text as one line, without the marks that begin the lines of a comment.
fn joined(text: &str) -> String {
    let content = |line: &str| {
        let line = line.trim_start();
        ["///", "//!", "//", "#", "--"]
            .iter()
            .find_map(|mark| line.strip_prefix(mark))
            .unwrap_or(line)
            .trim()
            .to_owned()
    };
    text.lines().map(content).collect::<Vec<_>>().join(" ")
}

/// Every `docs/….md` of a text with the quoted sections behind it: `, "One" and "Another"` or `("One")`.
fn citations(text: &str) -> Vec<Citation> {
    let text = joined(text);
    let starts = text.match_indices("docs/").filter(|&(at, _)| {
        let before = text[..at].chars().next_back();
        !before.is_some_and(|before| before.is_alphanumeric() || "/-_.".contains(before))
    });
    let mut found = Vec::new();
    for (at, _) in starts {
        let rest = &text[at..];
        let end =
            rest.find(|mark: char| !(mark.is_ascii_alphanumeric() || "/-_.".contains(mark))).unwrap_or(rest.len());
        let path = rest[..end].trim_end_matches('.');
        if !path.ends_with(".md") {
            continue;
        }
        let mut behind = rest[path.len()..].trim_start_matches('`');
        let mut sections = Vec::new();
        while let Some((section, next)) = [", \"", " (\"", " and \""]
            .iter()
            .find_map(|mark| behind.strip_prefix(mark))
            .and_then(|quoted| quoted.split_once('"'))
        {
            sections.push(section.to_owned());
            behind = next;
        }
        found.push(Citation { path: path.to_owned(), sections });
    }
    found
}

/// The headings of a page.
fn headings(page: &str) -> Vec<&str> {
    let mut fenced = false;
    let lines = page.lines().filter(move |line| {
        fenced ^= line.starts_with("```");
        !fenced
    });
    lines.filter_map(|line| line.strip_prefix('#')).map(|line| line.trim_start_matches('#').trim()).collect()
}

/// The anchor that a link to a heading has.
fn anchor(heading: &str) -> String {
    let kept = heading.to_lowercase();
    kept.chars().filter(|mark| mark.is_alphanumeric() || " -_".contains(*mark)).collect::<String>().replace(' ', "-")
}

#[test]
fn citations_are_found_over_the_ends_of_lines() {
    let text =
        "//! A wave (docs/functions/one.md,\n//! \"Start and\n//! end\" and \"Phase\"), as `docs/two.md` says.\n";
    let one = Citation { path: "docs/functions/one.md".into(), sections: vec!["Start and end".into(), "Phase".into()] };
    assert_eq!(citations(text), [one, Citation { path: "docs/two.md".into(), sections: vec![] }]);
    let text = "/// As in docs/one.md (\"Motion\"): …";
    assert_eq!(citations(text), [Citation { path: "docs/one.md".into(), sections: vec!["Motion".into()] }]);
}

#[test]
fn every_cited_page_and_section_is_there() {
    let mut cited = 0;
    for path in texts().iter().filter(|path| *path != Path::new("tests/documents.rs")) {
        for Citation { path: page, sections } in citations(&read(path)) {
            let page_path = Path::new(&page);
            assert!(Path::new(REPOSITORY).join(page_path).is_file(), "{}: {page} is not there", path.display());
            let text = read(page_path);
            for section in sections {
                assert!(headings(&text).contains(&section.as_str()), "{}: {page} has no {section:?}", path.display());
                cited += 1;
            }
        }
    }
    assert!(cited >= 40, "{cited} sections are cited");
}

#[test]
fn the_page_of_a_function_names_all_of_its_findings() {
    let functions = "service/cutting/src/functions";
    let mut seen = 0;
    for entry in fs::read_dir(Path::new(REPOSITORY).join(functions)).expect("the functions") {
        let function = entry.expect("an entry").file_name().into_string().expect("a name");
        let table = Path::new(functions).join(&function).join("code.rs");
        if !Path::new(REPOSITORY).join(&table).exists() {
            continue;
        }
        let page = PAGES.iter().find(|(name, _)| *name == function);
        let (_, page) = page.unwrap_or_else(|| panic!("which page of docs/functions is about {function}?"));
        let text = read(Path::new(page));
        let table = read(&table);
        let codes = table.lines().filter_map(|line| line.trim().strip_prefix('"')?.split_once("\" ["));
        for (code, _) in codes {
            assert!(text.contains(&format!("`{code}`")), "{page} does not name {code}");
            seen += 1;
        }
    }
    assert!(seen > 50, "{seen} codes");
}

#[test]
fn nothing_cites_a_source_that_is_not_in_the_repository() {
    for path in texts().iter().filter(|path| *path != Path::new("tests/documents.rs")) {
        let text = joined(&read(path));
        for words in ELSEWHERE {
            assert!(!text.contains(words), "{} cites a source that is not here: {words:?}", path.display());
        }
    }
}

#[test]
fn every_link_of_a_document_leads_somewhere() {
    let mut links = 0;
    for path in texts().iter().filter(|path| path.extension().is_some_and(|extension| extension == "md")) {
        let text = read(path);
        for (target, _) in text.split("](").skip(1).filter_map(|rest| rest.split_once(')')) {
            if target.contains("://") {
                continue;
            }
            let (file, section) = target.split_once('#').unwrap_or((target, ""));
            let folder = path.parent().expect("a folder");
            let linked = if file.is_empty() { path.clone() } else { folder.join(file) };
            assert!(Path::new(REPOSITORY).join(&linked).exists(), "{}: {target} is not there", path.display());
            let is_there =
                section.is_empty() || headings(&read(&linked)).iter().any(|heading| anchor(heading) == section);
            assert!(is_there, "{}: {target} has no such section", path.display());
            links += 1;
        }
    }
    assert!(links >= 20, "{links} links");
}

/// Cargo finds test files by itself only where a crate has a binary for each.
#[test]
fn every_test_file_of_a_crate_is_compiled() {
    let mut count = 0;
    for entry in fs::read_dir(Path::new(REPOSITORY).join("service")).expect("the crates") {
        let krate = entry.expect("a crate").path();
        let Ok(main) = fs::read_to_string(krate.join("tests/main.rs")) else { continue };
        let manifest = fs::read_to_string(krate.join("Cargo.toml")).expect("a manifest");
        for entry in fs::read_dir(krate.join("tests")).expect("its tests") {
            let path = entry.expect("an entry").path();
            let name = path.file_stem().and_then(|name| name.to_str()).expect("a name");
            let is_named = main.contains(&format!("\nmod {name};\n")) || manifest.contains(&format!("\"tests/{name}"));
            assert!(is_named, "{}: no binary has it", path.display());
            count += 1;
        }
    }
    assert!(count > 50, "{count} files");
}
