// Sums over a workgroup of 256 with their rounding errors; see compensated.rs.
const LANES: u32 = 256u;
var<workgroup> lane_sum: array<vec4<f32>, 256>;
var<workgroup> lane_rest: array<vec4<f32>, 256>; // what the sums have lost

// Sum over a workgroup of 256; thread 0 has the result. `lost_before` is the rounding error of each thread's sum.
fn compensated_sum(p: Params, own: vec4<f32>, lost_before: vec4<f32>, lane: u32) -> vec4<f32> {
    var sum = own;
    var rest = lost_before;
    lane_sum[lane] = sum;
    lane_rest[lane] = rest;
    for (var n = LANES / 2u; n > 0u; n >>= 1u) {
        workgroupBarrier();
        if lane < n {
            let part = lane_sum[lane + n];
            rest += lane_rest[lane + n];
            if p.compensated == 1u { rest += lost(sum, part, p.zero); }
            sum += part;
            lane_sum[lane] = sum;
            lane_rest[lane] = rest;
        }
    }
    return sum + rest;
}
