//! `feedwave lsp` on files that other programs call.

use std::fs;

use serde_json::{Value, json};

use super::{Session, at, codes, follow, uri};

/// Machine, file, text, and what is found in it.
type Case = (&'static str, &'static str, &'static str, &'static [(u64, &'static str)]);

/// Programs that are called, and what is found in each whatever calls it, by line and code.
#[test]
fn what_is_called_is_judged_for_what_holds_whatever_calls_it() {
    let cases: [Case; 12] = [
        // Neither feed nor spindle, tool, plane, position nor motion are its own.
        ("mill", "O9001.nc", "O9001 (SLOT)\nG1 X41 Y30\nX50\nG3 X60 Y40 R10\nM99\n", &[]),
        ("mill", "HOLES.NC", "%\nO2000\nX10 Y10\nX20 R1 Z-5\nG80\nM99\n%", &[]),
        ("mill", "O9002.nc", "O9002\nG40\nG49\nG201\nG91 G1 Z-1 F#9\nG90\nM99 P100\n", &[]),
        ("mill", "9003", "G1 X#1 Y[#2+#101]\nIF [#3 EQ #0] GOTO 9\nG1 X#3\nN9 M99\n", &[]),
        ("mill", "O9004.nc", "O9004\nIF [#1 NE #0] GOTO 10\n#3000=1 (NO A)\nN10 G1 X#1\nM99\n", &[]),
        ("lathe", "O9005.nc", "O9005\nG1 U-2. W-5.\nX18.2\nZ-3. R0.5\nM99\n", &[]),
        ("lathe", "O9006.nc", "O9006\nG90 X40. Z-20.\nM99\n", &[]),
        (
            "linuxcnc",
            "rim.ngc",
            "o<rim> sub\nG1 X#1 F[#<_feed>]\no1 if [#2 GT 0]\nG1 Y#2\no1 endif\no<rim> endsub\n",
            &[],
        ),
        // What is wrong in itself.
        (
            "mill",
            "O9007.nc",
            "O9007\nG1 X1..5 Y2\nG1 X1 X2\nG1 Y0 Q5\nG9999\nM99\n",
            &[(2, "PRG-NUMBER-INVALID"), (3, "PRG-WORD-DUPLICATE"), (4, "PRG-WORD-UNUSED"), (5, "PRG-UNKNOWN-CODE")],
        ),
        // Also where none of the callers come to, or one.
        ("mill", "O9008.nc", "O9008\nGOTO 9\nG1 X1..5\nN9 M99\n", &[(3, "PRG-NUMBER-INVALID")]),
        ("mill", "O9009.nc", "O9009\nIF [#1 NE #0] GOTO 9\nG1 X1 X2\nN9 M99\n", &[(3, "PRG-WORD-DUPLICATE")]),
        (
            "linuxcnc",
            "rim.ngc",
            "o<rim> sub\nG1 X1 X2\nG9999\no<rim> endsub\nM2\n",
            &[(2, "PRG-WORD-DUPLICATE"), (3, "PRG-UNKNOWN-CODE")],
        ),
    ];
    for (kind, name, text, expected) in cases {
        let directory = tempfile::tempdir().unwrap();
        let options = match kind {
            "linuxcnc" => {
                let profile = "[machine]\nkind = \"MACHINE_KIND_MILL\"\n[language]\ndialect = \"DIALECT_LINUXCNC\"\n";
                fs::write(directory.path().join("linuxcnc.toml"), profile).unwrap();
                json!({ "profile": "linuxcnc.toml" })
            }
            kind => json!({ "machine_kind": kind }),
        };
        let mut session = Session::initialized(directory.path(), &options);
        let name = uri(&directory.path().join(name));
        session.open(&name, text);
        let shown = session.shown(&name, 1);
        let line = |it: &Value| it["range"]["start"]["line"].as_u64().unwrap() + 1;
        let found: Vec<_> = shown.iter().map(|it| (line(it), it["code"].as_str().unwrap_or("?"))).collect();
        assert_eq!(found, expected, "{text}{shown:#?}");
        let whole = json!({ "start": { "line": 0, "character": 0 }, "end": { "line": 99, "character": 0 } });
        let hints = session.ask("textDocument/inlayHint", &json!({ "textDocument": { "uri": name }, "range": whole }));
        assert_eq!(hints["result"], json!([]));
        session.end();
    }
}

#[test]
fn a_hover_in_what_is_called_says_what_is_known_whatever_calls_it() {
    let directory = tempfile::tempdir().unwrap();
    let mut session = Session::initialized(directory.path(), &json!({ "machine_kind": "mill" }));
    let name = uri(&directory.path().join("O9001.nc"));
    session.open(&name, "O9001\nG1 X41\nG90 G1 X41 F500\nG91 Z-2\nG90 Y3\nS900 M3\nG0 Z7\nM99\n");
    let mut hover = |line: u32| {
        let answer = session.ask("textDocument/hover", &at(&name, line, 0));
        answer["result"]["contents"]["value"].as_str().unwrap_or_default().to_owned()
    };
    let depends = "- all else depends on the program that calls this one\n";
    assert_eq!(hover(1), depends);
    assert_eq!(hover(2), format!("- position: x41 mm, X a radius\n{depends}"));
    assert_eq!(hover(3), format!("- position: x41 mm, X a radius\n{depends}"));
    assert_eq!(hover(4), format!("- position: x41 y3 mm, X a radius\n{depends}"));
    assert_eq!(hover(6), format!("- position: x41 y3 z7 mm, X a radius\n- spindle: M3 S900\n{depends}"));
    session.end();
}

#[test]
fn what_is_called_finds_what_it_calls_and_counts_as_the_editor_has_it() {
    let directory = tempfile::tempdir().unwrap();
    let root = directory.path();
    fs::create_dir(root.join("subs")).unwrap();
    // What is on the disk of the file that is open counts no more, and it calls the other.
    fs::write(root.join("subs/O9001.nc"), "O9001\nG9999\nM99\n").unwrap();
    fs::write(root.join("subs/O9002.nc"), "O9002\nT0101 S900 M3\nG1 X1 Q5\nM99\n").unwrap();
    fs::write(root.join("feedwave.toml"), "[validate]\nmachine_kind = \"mill\"\ninclude = \"subs\"\n").unwrap();
    let mut session = Session::initialized(root, &json!({}));
    let name = uri(&root.join("subs/O9001.nc"));
    session.open(&name, "O9001\nG1 X5\nM98 P9002\nM98 P9003\nM99\n");
    let shown = session.shown(&name, 1);
    assert_eq!(codes(&shown), ["PRG-WORD-UNUSED", "PRG-SUBPROGRAM-MISSING"], "{shown:#?}");
    assert_eq!((&shown[0]["range"]["start"]["line"], &shown[1]["range"]["start"]["line"]), (&json!(2), &json!(3)));
    assert_eq!(shown[0]["relatedInformation"][0]["location"]["uri"], uri(&root.join("subs/O9002.nc")));
    // One that has all that a cut needs is called as well, as it is among the files that are called.
    let prepared = uri(&root.join("subs/O9002.nc"));
    session.open(&prepared, "O9002\nT1 S900 M3\nG1 X1\nM99\n");
    assert_eq!(session.shown(&prepared, 1), Vec::<Value>::new());
    // Elsewhere it is a main program that begins again, as for a bar feeder.
    let main = uri(&root.join("main.nc"));
    session.open(&main, "O1\nT1 S900 M3\nG1 X1\nM99\n");
    assert_eq!(codes(&session.shown(&main, 1)), ["PRG-FEED-MISSING", "PRG-MAIN-RETURN"]);
    session.end();
}

#[test]
fn a_session_with_what_is_called_is_as_it_was() {
    follow("lsp-called-session.jsonl");
}
