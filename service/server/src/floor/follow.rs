//! What the log says of jobs whose runs the floor shows, whoever did it: a client of this or another replica, or retention.

use feedwave_contract::proto::Execution;
use feedwave_store::{JobEvent, JobState, Store, StoreError};
use uuid::Uuid;

use super::restore::view_of;
use super::{Floor, Floors};
use crate::error::{Error, Result};
use crate::events::EventReader;
use crate::stored::condition_to_proto;

/// Keeps the floors as the log has them, until there are no more events.
pub(crate) async fn follow(floors: Floors, store: Store, mut events: EventReader) {
    while let Some(events) = events.next().await {
        for event in events {
            if let Err(error) = floors.take_in(&store, &event).await {
                tracing::warn!(%error, job = %event.job_id, "what became of a job is not seen on its machine");
            }
        }
    }
}

impl Floors {
    async fn take_in(&self, store: &Store, event: &JobEvent) -> Result<()> {
        let Some(floor) = self.known(event.tenant) else { return Ok(()) };
        let job = event.job_id;
        match event.to_state {
            None => {
                for machine in floor.machines_of(job) {
                    floor.forget_job(&machine, job);
                }
                Ok(())
            }
            // Its runs cannot be taken up any more.
            Some(JobState::Cancelled | JobState::Failed) => floor.renew_interrupted(store, job).await,
            // Something of its runs was told, such as an acknowledgement.
            to if to == event.from_state => floor.renew_conditions(store, job).await,
            _ => Ok(()),
        }
    }

    /// Forgets runs that are in the store no more.
    ///
    /// # Errors
    /// Those of the store.
    pub(crate) async fn forget_removed(&self, store: &Store) -> Result<(), StoreError> {
        for (_, floor) in self.all() {
            for (machine, run) in floor.runs(|_| true) {
                match store.run(run).await {
                    Err(StoreError::NotFound { .. }) => floor.forget_run(&machine, run),
                    Err(error) => return Err(error),
                    Ok(_) => {}
                }
            }
        }
        Ok(())
    }
}

impl Floor {
    /// Runs that are not connected or have conditions, of the jobs that are wanted, with their machines.
    fn runs(&self, wanted: impl Fn(Uuid) -> bool) -> Vec<(String, Uuid)> {
        let board = self.board();
        let mut runs = Vec::new();
        for (id, machine) in &board.machines {
            let resting = machine.resting.iter().map(|view| (view.id, view.job_id));
            let logged = machine.logged.iter().map(|logged| (logged.run, logged.job_id));
            let of_machine = resting.chain(logged).filter(|(_, job)| wanted(*job));
            runs.extend(of_machine.map(|(run, _)| (id.clone(), run)));
        }
        runs.dedup();
        runs
    }

    fn forget_run(&self, machine_id: &str, run: Uuid) {
        self.change(machine_id, |machine| {
            machine.resting = machine.resting.take().filter(|view| view.id != run);
            machine.logged.retain(|logged| logged.run != run);
        });
    }

    /// Shows that runs of a job that ended are over.
    async fn renew_interrupted(&self, store: &Store, job: Uuid) -> Result<()> {
        for (machine, run) in self.runs(|of| of == job) {
            let is_open = |floor: &Self| {
                let board = floor.board();
                let resting = board.machines.get(&machine).and_then(|machine| machine.resting.as_ref());
                resting.is_some_and(|view| view.id == run && view.activity.execution() == Execution::Interrupted)
            };
            if !is_open(self) {
                continue;
            }
            let view = match store.run(run).await {
                Ok(record) => view_of(store, &record).await?,
                // It was deleted meanwhile, which is an event of its own.
                Err(StoreError::NotFound { .. }) => continue,
                Err(error) => return Err(error.into()),
            };
            self.change(&machine, |machine| {
                if let Some(resting) = machine.resting.as_mut().filter(|resting| resting.id == run) {
                    *resting = view;
                }
            });
        }
        Ok(())
    }

    /// Takes over acknowledgements of conditions of a job's runs.
    async fn renew_conditions(&self, store: &Store, job: Uuid) -> Result<()> {
        for (machine, run) in self.runs(|of| of == job) {
            let conditions = store.run_conditions(run).await.map_err(Error::from)?;
            for condition in conditions.iter().filter(|condition| condition.acknowledged.is_some()) {
                self.acknowledge(&machine, run, &condition_to_proto(condition));
            }
        }
        Ok(())
    }
}
