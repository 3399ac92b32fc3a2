//! What is kept no longer, by age and by size, whichever database it is in: which records may go, and in which order.

use std::time::Duration;

use async_trait::async_trait;
use uuid::Uuid;

use super::check::Parameter;
use super::logs::TenantLog;
use super::objects::ObjectSteps;
use super::record::parse;
use crate::error::{Result, StoreError};
use crate::jobs::Jobs;
use crate::programs::{ProgramKey, Programs};
use crate::retention::{Removed, Retention, RetentionPolicy};

/// Records removed by one write.
const BATCH: i64 = 100;

/// Programs younger than this are not removed for the sake of size: their jobs may be yet to come.
const UNUSED: Duration = Duration::from_secs(3_600);

/// Jobs that may go and were changed before a time, `$1`.
const JOBS: &str = "FROM jobs AS j WHERE j.state IN ('ready', 'rejected', 'cancelled', 'failed') AND j.updated_us < $1
    AND (j.state = 'cancelled' OR NOT EXISTS (SELECT 1 FROM runs AS r WHERE r.job_id = j.id AND r.state = 'open'))";
const RUNS: &str = "FROM runs AS j WHERE j.state <> 'open' AND j.updated_us < $1";
const PROGRAMS: &str = "FROM programs AS j WHERE j.created_us < $1
    AND NOT EXISTS (SELECT 1 FROM jobs WHERE program_id = j.id)
    AND NOT EXISTS (SELECT 1 FROM job_programs WHERE program_id = j.id)";
const EVENTS: &str = "FROM job_events AS j WHERE j.at_us < $1";
const AUDIT: &str = "FROM audit_entries AS j WHERE j.at_us < $1";

/// Programs that may go and were made before a time, `$1`, once the jobs are gone that were changed before `jobs_cutoff`.
fn programs_without(jobs_cutoff: Option<i64>) -> String {
    let stays = jobs_cutoff.map_or_else(String::new, |cutoff| {
        format!("AND k.id NOT IN (SELECT j.id {})", JOBS.replace("$1", &cutoff.to_string()))
    });
    format!(
        "FROM programs AS p WHERE p.created_us < $1
            AND NOT EXISTS (SELECT 1 FROM jobs AS k WHERE k.program_id = p.id {stays})
            AND NOT EXISTS (SELECT 1 FROM job_programs AS f JOIN jobs AS k ON k.id = f.job_id WHERE f.program_id = p.id {stays})"
    )
}

/// The steps that a database does, and what is made of them.
#[async_trait]
pub(crate) trait RetentionSteps: ObjectSteps + Jobs + Programs {
    /// The number that a query with a parameter, `$1`, answers.
    async fn number(&self, sql: String, parameter: i64) -> Result<i64>;

    /// The identifiers, `id`, that a query with a parameter, `$1`, answers.
    async fn ids(&self, sql: String, parameter: Parameter<'_>) -> Result<Vec<String>>;

    /// Does a statement with a parameter, `$1`; to how many rows.
    async fn change(&self, sql: String, parameter: i64) -> Result<u64>;

    /// Removes entries of the audit log from before a time, at most so many; how many.
    async fn remove_audit(&self, cutoff_us: i64, most: i64) -> Result<u64>;

    /// Bytes of what is kept.
    async fn bytes_in_use(&self) -> Result<u64>;

    /// Bytes of these that go with a job and, where no other one uses them, its programs; more than there can be where asking for all
    /// anew costs no more.
    async fn bytes_of_job(&self, _id: &str) -> Result<u64> {
        Ok(u64::MAX)
    }

    /// Bytes among these that no job goes to make room for: of unfinished programs, of those made since a time that no job
    /// uses yet, and of logs that have bounds of their own.
    async fn bytes_set_aside(&self, since_us: i64) -> Result<u64>;

    /// Gives free space back to the file system, where that is for the store to do.
    async fn give_back(&self) -> Result<()>;

    /// The time before which a record is older than this.
    fn cutoff(&self, age: Duration) -> i64 {
        self.now_us().saturating_sub(i64::try_from(age.as_micros()).unwrap_or(i64::MAX))
    }

    async fn count(&self, from: &str, age: Option<Duration>) -> Result<u64> {
        let Some(age) = age else { return Ok(0) };
        Ok(self.number(format!("SELECT COUNT(*) {from}"), self.cutoff(age)).await?.unsigned_abs())
    }

    /// Removes records, oldest first, once it is noted what goes of a log with them: by `note`, of a batch of them; how many.
    async fn remove(&self, table: &str, from: &str, cutoff: i64, note: for<'b> fn(&'b str) -> String) -> Result<u64> {
        let mut removed = 0;
        loop {
            let last = format!(
                "SELECT COALESCE(MAX(b.sequence), -1) FROM (SELECT j.sequence {from} ORDER BY j.sequence LIMIT {BATCH}) AS b"
            );
            let last = self.number(last, cutoff).await?;
            if last < 0 {
                return Ok(removed);
            }
            // By its end: whoever else removes at the same time, no more goes than what is noted.
            let batch = format!("{from} AND j.sequence <= {last}");
            self.change(note(&batch), cutoff).await?;
            let sql = format!("DELETE FROM {table} WHERE sequence IN (SELECT j.sequence {batch})");
            removed += self.change(sql, cutoff).await?;
        }
    }

    /// Removes a job, which is logged as deleted; false if it is gone already.
    async fn remove_job(&self, id: &str) -> Result<bool> {
        let id: Uuid = parse(id, "id")?;
        match self.delete_job(id, None).await {
            Ok(()) => Ok(true),
            Err(StoreError::NotFound { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Removes a program; false if it is gone already, or a job was created with it meanwhile.
    async fn remove_program(&self, id: &str) -> Result<bool> {
        let ProgramKey(id) = parse(id, "id")?;
        match self.delete_program(id).await {
            Ok(()) => Ok(true),
            Err(StoreError::NotFound { .. } | StoreError::InUse { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    async fn remove_jobs(&self, cutoff: i64) -> Result<u64> {
        let mut removed = 0;
        loop {
            let sql = format!("SELECT j.id {JOBS} ORDER BY j.sequence LIMIT {BATCH}");
            let before = removed;
            for id in self.ids(sql, Parameter::Integer(cutoff)).await? {
                removed += u64::from(self.remove_job(&id).await?);
            }
            if removed == before {
                return Ok(removed);
            }
        }
    }

    async fn remove_programs(&self, cutoff: i64) -> Result<u64> {
        let mut removed = 0;
        loop {
            let sql = format!("SELECT j.id {PROGRAMS} ORDER BY j.sequence LIMIT {BATCH}");
            let ids = self.ids(sql, Parameter::Integer(cutoff)).await?;
            let before = removed;
            for id in &ids {
                removed += u64::from(self.remove_program(id).await?);
            }
            if ids.len() < BATCH as usize || removed == before {
                return Ok(removed);
            }
        }
    }

    /// Removes the oldest job that may go, with the programs that no other one uses: whatever their age, theirs has come. Bytes that go
    /// with them, at most.
    async fn remove_oldest_job(&self, removed: &mut Removed) -> Result<Option<u64>> {
        let sql = format!("SELECT j.id {JOBS} ORDER BY j.sequence LIMIT 1");
        let Some(job) = self.ids(sql, Parameter::Integer(i64::MAX)).await?.pop() else { return Ok(None) };
        let bytes = self.bytes_of_job(&job).await?;
        let used = "SELECT program_id AS id FROM jobs WHERE id = $1
            UNION SELECT program_id FROM job_programs WHERE job_id = $1";
        let used = self.ids(used.to_owned(), Parameter::Text(&job)).await?;
        removed.jobs += u64::from(self.remove_job(&job).await?);
        for program in &used {
            removed.programs += u64::from(self.remove_program(program).await?);
        }
        Ok(Some(bytes))
    }

    /// Removes the oldest jobs until so many bytes may have gone with them; whether there was one.
    async fn remove_oldest_jobs(&self, bytes: u64, removed: &mut Removed) -> Result<bool> {
        let mut gone = 0_u64;
        while gone < bytes {
            let Some(bytes) = self.remove_oldest_job(removed).await? else { return Ok(gone > 0) };
            // Of a job without a byte too: it is gone.
            gone = gone.saturating_add(bytes.max(1));
        }
        Ok(true)
    }

    /// Removes the oldest jobs that have ended, and the programs that no job uses then, until what is kept of them has no
    /// more than so many bytes.
    async fn remove_beyond(&self, bytes: u64, removed: &mut Removed) -> Result<()> {
        if self.bytes_in_use().await? <= bytes {
            return Ok(());
        }
        removed.programs += self.remove_programs(self.cutoff(UNUSED)).await?;
        let most = bytes.saturating_add(self.bytes_set_aside(self.cutoff(UNUSED)).await?);
        loop {
            let beyond = self.bytes_in_use().await?.saturating_sub(most);
            if beyond == 0 || !self.remove_oldest_jobs(beyond, removed).await? {
                return Ok(());
            }
        }
    }
}

#[async_trait]
impl<S: RetentionSteps> Retention for S {
    async fn expired(&self, policy: &RetentionPolicy) -> Result<Removed> {
        Ok(Removed {
            jobs: self.count(JOBS, policy.jobs).await?,
            runs: self.count(RUNS, policy.runs).await?,
            programs: self.count(&programs_without(policy.jobs.map(|age| self.cutoff(age))), policy.programs).await?,
            events: self.count(EVENTS, policy.events).await?,
            audit: self.count(AUDIT, policy.audit).await?,
        })
    }

    async fn remove_expired(&self, policy: &RetentionPolicy) -> Result<Removed> {
        let mut removed = Removed::default();
        if let Some(age) = policy.runs {
            let note = |batch: &str| TenantLog::Decisions.note_removal(&format!("j.run_id IN (SELECT j.id {batch})"));
            removed.runs = self.remove("runs", RUNS, self.cutoff(age), note).await?;
        }
        if let Some(age) = policy.jobs {
            removed.jobs = self.remove_jobs(self.cutoff(age)).await?;
        }
        if let Some(age) = policy.programs {
            removed.programs = self.remove_programs(self.cutoff(age)).await?;
        }
        if let Some(age) = policy.events {
            let note =
                |batch: &str| TenantLog::Events.note_removal(&format!("j.sequence IN (SELECT j.sequence {batch})"));
            removed.events = self.remove("job_events", EVENTS, self.cutoff(age), note).await?;
        }
        if let Some(age) = policy.audit {
            let cutoff = self.cutoff(age);
            loop {
                let gone = self.remove_audit(cutoff, BATCH).await?;
                removed.audit += gone;
                if gone < BATCH.unsigned_abs() {
                    break;
                }
            }
        }
        if let Some(bytes) = policy.bytes {
            self.remove_beyond(bytes, &mut removed).await?;
        }
        self.give_back().await?;
        Ok(removed)
    }
}
