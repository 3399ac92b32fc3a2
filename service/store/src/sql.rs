//! What the databases behind SQL have in common: how records are packed, and how rows become records and pages.

pub(crate) mod audit;
pub(crate) mod check;
pub(crate) mod checkpoints;
pub(crate) mod clock;
pub(crate) mod compress;
pub(crate) mod documents;
pub(crate) mod fault;
pub(crate) mod jobs;
pub(crate) mod logs;
pub(crate) mod migrations;
pub(crate) mod objects;
pub(crate) mod pages;
pub(crate) mod programs;
pub(crate) mod record;
pub(crate) mod retention;
pub(crate) mod run_checkpoints;
pub(crate) mod runs;
pub(crate) mod seal;
pub(crate) mod uploads;
pub(crate) mod validations;
