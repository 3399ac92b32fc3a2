//! The shared suite on SQLite files with a write-ahead log, as in production.

mod suite;

use std::time::Duration;

use feedwave_store::{Store, StoreSettings};
use tempfile::TempDir;

struct SqliteFile(TempDir);

impl suite::Backend for SqliteFile {
    type Store = Store;

    fn new() -> Self {
        Self(TempDir::new().expect("a temporary folder"))
    }

    async fn open(&self, settings: StoreSettings) -> Store {
        // However slowly a store that was dropped lets go of the file.
        let settings = StoreSettings { busy_timeout: Duration::from_secs(600), ..settings };
        Store::open(self.0.path().join("feedwave.db"), settings).await.expect("opens")
    }
}

suite::suite! { super::SqliteFile:
    programs {
        put_is_idempotent_and_addressed_by_content,
        concurrent_puts_store_one_program,
        any_chunk_is_read_alone,
        too_large_is_refused,
        a_referenced_program_stays,
        a_deleted_program_can_be_put_again,
    }
    uploads {
        pieces_of_any_size_make_the_program,
        an_empty_program_needs_no_bytes,
        an_upload_resumes_after_reopening,
        a_wrong_offset_names_the_right_one,
        of_racing_appends_one_wins,
        a_wrong_hash_discards_the_upload,
        uploads_are_limited_listed_and_deleted,
        a_program_that_came_another_way_wins,
    }
    jobs {
        a_job_is_kept_as_it_was_created,
        the_same_request_makes_one_job,
        the_same_request_with_other_content_conflicts,
        a_job_needs_its_program_and_its_bounds,
        transitions_compare_store_and_log,
        of_racing_transitions_one_wins,
        large_reports_come_back_whole,
        deleting_a_job_leaves_its_log,
        events_are_followed_without_gaps,
        lists_filter_and_page_newest_first,
        pages_are_bounded_and_stable_while_inserting,
        foreign_and_damaged_tokens_are_refused,
    }
    checkpoints {
        the_nearest_before_is_found,
        sets_are_replaced_and_deleted_whole,
        bounds_are_kept,
    }
    runs {
        a_run_goes_on_where_its_last_commit_left_it,
        only_the_newest_attachment_writes,
        an_ended_run_takes_nothing_more,
        conditions_stay_until_somebody_has_seen_them,
        decisions_are_followed_without_gaps,
        runs_need_their_job_and_go_with_it,
        runs_page_newest_first,
    }
    documents {
        machines_are_created_updated_deleted_by_etag,
        of_racing_updates_one_wins,
        tools_are_found_by_number,
        documents_are_bounded,
    }
}
