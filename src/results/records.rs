//! The tables that one simulation writes on request: trace, map, profile, contact log.

use crate::model::{Change, ContactEvent};
use crate::observe::{MapRow, ProfileRow, TraceRow};
use crate::table::columns::{Column, Getter, Table};

/// Shear force and displacement at regular instants.
pub fn trace() -> Table<TraceRow> {
    Table {
        name: "trace",
        meaning: "One row per sample of a simulation",
        columns: vec![
            Column::new("time", "s", "time", Getter::Real(|row| row.time)),
            Column::new("force", "N", "shear force F_S", Getter::Real(|row| row.force)),
            Column::new("displacement", "m", "displacement of the trailing edge", Getter::Real(|row| row.displacement)),
            Column::new(
                "attached_fraction",
                "",
                "attached contacts over all contacts",
                Getter::Real(|row| row.attached_fraction),
            ),
        ],
    }
}

/// Attached fraction of each block at regular instants.
pub fn map() -> Table<MapRow> {
    Table {
        name: "map",
        meaning: "One row per sample and block",
        columns: vec![
            Column::new("time", "s", "time", Getter::Real(|row| row.time)),
            Column::new("block", "", "block, counted from 1 at the trailing edge", Getter::Count(|row| row.block)),
            Column::new(
                "attached_fraction",
                "",
                "attached contacts over the contacts of the block",
                Getter::Real(|row| row.attached_fraction),
            ),
        ],
    }
}

/// Displacement of each block at the end.
pub fn profile() -> Table<ProfileRow> {
    Table {
        name: "profile",
        meaning: "One row per block, at the end of a simulation",
        columns: vec![
            Column::new("time", "s", "time of the end", Getter::Real(|row| row.time)),
            Column::new("block", "", "block, counted from 1 at the trailing edge", Getter::Count(|row| row.block)),
            Column::new("position", "m", "position j L/N of the block", Getter::Real(|row| row.position)),
            Column::new(
                "displacement",
                "m",
                "displacement of the block since the start",
                Getter::Real(|row| row.displacement),
            ),
        ],
    }
}

/// Every contact event in order.
pub fn contacts() -> Table<ContactEvent> {
    Table {
        name: "contacts",
        meaning: "One row per contact event, in order; with the initial attachment",
        columns: vec![
            Column::new("time", "s", "time of the event", Getter::Real(|event| event.time)),
            Column::new(
                "block",
                "",
                "block, counted from 1 at the trailing edge",
                Getter::Count(|event| event.block as u64 + 1),
            ),
            Column::new(
                "contact",
                "",
                "contact within its block, counted from 1",
                Getter::Count(|event| event.contact as u64 + 1),
            ),
            Column::new(
                "generation",
                "",
                "life of the contact, 0 is the initial attachment",
                Getter::Count(|event| u64::from(event.generation)),
            ),
            Column::new("event", "", "attach or break", Getter::Text(|event| word(event.change).to_owned())),
            Column::new("displacement", "m", "displacement of the block", Getter::Real(|event| event.displacement)),
            Column::new(
                "force",
                "N",
                "force of the contact at the event, positive when it pulls the block back",
                Getter::Real(|event| event.force),
            ),
            Column::new("threshold", "N", "threshold of this life", Getter::Real(|event| event.threshold)),
            Column::new("stiffness", "N/m", "stiffness of this life", Getter::Real(|event| event.stiffness)),
        ],
    }
}

const fn word(change: Change) -> &'static str {
    match change {
        Change::Attach => "attach",
        Change::Break => "break",
    }
}
