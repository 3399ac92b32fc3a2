//! Rebuilds the crate when a migration is added: `sqlx::migrate!` embeds the folder's files, but
//! the compiler only watches those it saw the last time.

fn main() {
    for database in ["postgres", "sqlite"] {
        println!("cargo:rerun-if-changed=../../migrations/{database}");
    }
}
