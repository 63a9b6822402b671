//! The engine itself, in small scenes: bodies, contacts, cuts, meshes, energies, states.

mod blade;
mod bodies;
mod breaking;
mod broad;
mod carving;
mod contact_laws;
mod crossing;
#[path = "../shared/crumbs.rs"]
mod crumbs;
mod cut;
mod embedded;
mod energy;
#[path = "../shared/falls.rs"]
mod falls;
mod features;
mod fitted;
mod halves;
mod in_full;
mod incision;
#[path = "../shared/inside.rs"]
mod inside;
mod lips;
mod loose;
mod many_points;
mod meshes;
mod networks;
mod parts;
mod pit;
#[path = "../shared/ragged.rs"]
mod ragged;
mod resting;
mod robust;
mod round;
#[path = "../shared/small.rs"]
mod small;
mod state;
#[path = "../shared/states.rs"]
mod states;
#[path = "../shared/sweeps.rs"]
mod sweeps;
mod tetrahedra;
mod tetrahedra_cut;
mod tip;
