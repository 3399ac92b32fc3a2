//! One floor for each tenant.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use feedwave_contract::proto::{Availability, MachineState};
use feedwave_store::Tenant;
use tokio::sync::Notify;

use super::Floor;

/// A machine in the store.
#[derive(Clone, Debug)]
struct Stored {
    etag: String,
    display_name: String,
}

#[derive(Debug, Default)]
struct Inner {
    machines: BTreeMap<String, Stored>,
    /// Rung where other replicas are to be told of runs at once; `None` where there are none.
    bell: Option<Arc<Notify>>,
    floors: BTreeMap<Tenant, Floor>,
}

/// The floors of all tenants. Machines are everybody's, runs their tenant's. Cloning is cheap.
#[derive(Clone, Debug, Default)]
pub(crate) struct Floors(Arc<Mutex<Inner>>);

impl Floors {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        // Every change leaves whole maps behind, so poisoned ones are valid.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What a tenant sees. A tenant without runs costs nothing once it does not look any more, so that asking for many names
    /// of tenants fills no memory.
    pub(crate) fn of(&self, tenant: Tenant) -> Floor {
        let mut inner = self.inner();
        if let Some(floor) = inner.floors.get(&tenant) {
            return floor.clone();
        }
        inner.floors.retain(|_, floor| !floor.is_blank());
        let floor = Floor::new();
        if let Some(bell) = &inner.bell {
            floor.share(bell.clone());
        }
        for (id, stored) in &inner.machines {
            floor.put_machine(id, &stored.etag, &stored.display_name);
        }
        inner.floors.insert(tenant, floor.clone());
        floor
    }

    /// What a tenant sees, where anything is known or anybody looks.
    pub(super) fn known(&self, tenant: Tenant) -> Option<Floor> {
        self.inner().floors.get(&tenant).cloned()
    }

    /// All floors that there are.
    pub(super) fn all(&self) -> Vec<(Tenant, Floor)> {
        self.inner().floors.iter().map(|(tenant, floor)| (*tenant, floor.clone())).collect()
    }

    /// From now on, other replicas are to be told of runs; of some at once, when this rings.
    pub(super) fn share(&self) -> Arc<Notify> {
        let bell = Arc::new(Notify::new());
        let mut inner = self.inner();
        inner.bell = Some(bell.clone());
        for floor in inner.floors.values() {
            floor.share(bell.clone());
        }
        bell
    }

    /// Versions of the machines in the store, as far as they are known, by identifier.
    pub(super) fn machines(&self) -> BTreeMap<String, String> {
        self.inner().machines.iter().map(|(id, stored)| (id.clone(), stored.etag.clone())).collect()
    }

    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.inner().floors.len()
    }

    /// A machine is in the store, in this version and under this name for people.
    pub(crate) fn put_machine(&self, id: &str, etag: &str, display_name: &str) {
        let mut inner = self.inner();
        let stored = Stored { etag: etag.to_owned(), display_name: display_name.to_owned() };
        inner.machines.insert(id.to_owned(), stored);
        for floor in inner.floors.values() {
            floor.put_machine(id, etag, display_name);
        }
    }

    /// A machine is in the store no more.
    pub(crate) fn remove_machine(&self, id: &str) {
        let mut inner = self.inner();
        inner.machines.remove(id);
        for floor in inner.floors.values() {
            floor.remove_machine(id);
        }
    }

    /// The first machines by identifier, at most `limit`, with what they do for any tenant: for who may see all.
    pub(crate) fn of_all_tenants(&self, limit: usize) -> Vec<MachineState> {
        // One that has every machine in the store, whoever else has one.
        self.of(Tenant::DEFAULT);
        let floors: Vec<Floor> = {
            let inner = self.inner();
            inner.floors.values().cloned().collect()
        };
        let mut machines: BTreeMap<String, MachineState> = BTreeMap::new();
        let states = floors.iter().flat_map(|floor| floor.states(None, limit));
        for state in states.map(|shown| shown.state.clone()) {
            match machines.get_mut(&state.machine) {
                Some(known) => join(known, state),
                None => {
                    machines.insert(state.machine.clone(), state);
                }
            }
        }
        machines.into_values().take(limit).collect()
    }
}

/// What a machine does for two tenants: what is connected is what it does now, otherwise the newer of both.
fn join(known: &mut MachineState, mut other: MachineState) {
    let rank = |state: &MachineState| {
        let since = state.execution_time.map_or((0, 0), |time| (time.seconds, time.nanos));
        (state.availability() == Availability::Available, since)
    };
    if rank(&other) > rank(known) {
        std::mem::swap(known, &mut other);
    }
    known.finished_runs += other.finished_runs;
    known.conditions.append(&mut other.conditions);
}
