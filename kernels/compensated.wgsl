// Sums over a workgroup of 256 with what rounding took from them; see compensated.rs.
const LANES: u32 = 256u;
var<workgroup> lane_sum: array<vec4<f32>, 256>;
var<workgroup> lane_rest: array<vec4<f32>, 256>; // what the sums have lost

// Sum over a workgroup of 256, which thread 0 has; `rest` is what each thread's sum has lost.
fn compensated_sum(p: Params, sum: vec4<f32>, lost_before: vec4<f32>, lane: u32) -> vec4<f32> {
    var rest = lost_before;
    lane_sum[lane] = sum;
    lane_rest[lane] = rest;
    for (var n = LANES / 2u; n > 0u; n >>= 1u) {
        workgroupBarrier();
        if lane < n {
            let part = lane_sum[lane + n];
            rest += lane_rest[lane + n];
            if p.compensated == 1u { rest += lost(lane_sum[lane], part, p.zero); }
            lane_sum[lane] += part;
            lane_rest[lane] = rest;
        }
    }
    return lane_sum[0] + rest;
}
