// Sums over a workgroup of 256 with their rounding errors; see compensated.rs.
const LANES: u32 = 256u;
var<workgroup> lane_sum: array<vec4<f32>, 256>;
var<workgroup> lane_compensation: array<vec4<f32>, 256>; // rounding errors of the sums

// Sum over a workgroup of 256; thread 0 has the result. `own_error` is the rounding error of each thread's sum.
fn compensated_sum(p: Params, own: vec4<f32>, own_error: vec4<f32>, lane: u32) -> vec4<f32> {
    var sum = own;
    var compensation = own_error;
    lane_sum[lane] = sum;
    lane_compensation[lane] = compensation;
    for (var n = LANES / 2u; n > 0u; n >>= 1u) {
        workgroupBarrier();
        if lane < n {
            let part = lane_sum[lane + n];
            compensation += lane_compensation[lane + n];
            if p.compensated == 1u { compensation += rounding_error(sum, part, p.zero); }
            sum += part;
            lane_sum[lane] = sum;
            lane_compensation[lane] = compensation;
        }
    }
    return sum + compensation;
}
