//! Defect of a step's linearisation on the device ([`crate::kernels::defect`]).

use super::GpuBackend;
use crate::bodies::Model;
use crate::bodies::gpu::{Arrays, Dispatch, Maker, Recorded, over_nodes};
use crate::error::Result;
use crate::gpu::{Batch, Bound, Buffer};
use crate::kernels::{Params, defect, integrate};

/// Arrays and dispatches of a body whose steps are solved in full.
pub(super) struct Defect {
    /// `[node]` displacements at the end of the increment, m.
    end: Buffer,
    /// Adds the increment to them, without and with the correction, which then is part of the increment.
    advance: [Bound; 2],
    /// Elastic forces there, product with the increment, and the defect; none for linear laws.
    added: Vec<Dispatch>,
}

impl Defect {
    /// `x` holds the solutions, `b` the right-hand sides; `blocks` are the parameters without and with the correction.
    pub fn new(
        made: &mut Maker,
        model: &Model,
        kind: &mut dyn Recorded,
        arrays: &Arrays,
        [x, b]: [&Buffer; 2],
        blocks: [&Buffer; 2],
    ) -> Result<Self> {
        made.gpu.making("defect of the linearisation");
        let n = model.node_count();
        let params: Params<f32> = Params { rhs_count: 1, ..model.params() };
        // integration of copies, whose velocities nothing reads
        let (end, unread) = (made.vec4("end", n)?, made.vec4("v", n)?);
        let gpu = made.gpu;
        let advance = |block: &Buffer| {
            let copies = [("params", block), ("x", x), ("u", &end), ("v", &unread)];
            gpu.bind(&integrate::SOURCE, &copies)
        };
        let advance = [advance(blocks[0])?, advance(blocks[1])?];
        let f_end = made.vec4("f_end", n)?;
        let mut added = vec![];
        if let Some(forces) = kind.forces_of_law(made, arrays, &end, &f_end)? {
            // a product of one vector, with sums and solver scalars of its own
            let sums = made.zeros::<f32>("partial_product", params.product_groups as usize)?;
            let own = [made.vec4("w", n)?, made.vec4("scalars", 2)?, sums];
            let main = made.params(&params);
            let own = arrays.joined(&Arrays::of(&own)).joined(&Arrays::one("z", x)).joined(&Arrays::one("x", x));
            added = forces;
            added.extend(kind.product(made, &own, &params, &main)?);
            let ends = [("params", &main), ("f_end", &f_end), ("b", b)];
            added.push((own.bind(made.gpu, &defect::SOURCE, &ends)?, over_nodes(&params)));
        }
        Ok(Self { end, advance, added })
    }
}

impl GpuBackend {
    /// See [`crate::backend::Backend::add_defect`].
    pub(super) fn record_defect(&mut self, corrected: bool) {
        let mut batch = self.record();
        if let Some(defect) = &self.defect {
            batch.copy(&self.body.u, 0, &defect.end, 0, self.offset(1));
            batch.run(&defect.advance[usize::from(corrected)], self.solver.in_use.nodes, 1);
            self.run_all(&mut batch, &self.right_hand_side);
            self.run_all(&mut batch, &defect.added);
        }
        self.pending = Some(batch);
    }

    /// Records dispatches over what is in use.
    pub(super) fn run_all(&self, batch: &mut Batch, list: &[Dispatch]) {
        for (kernel, threads) in list {
            let threads = self.solver.in_use.threads(*threads);
            if threads > 0 {
                batch.run(kernel, threads, 1);
            }
        }
    }
}
