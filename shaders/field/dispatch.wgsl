// The order in which a dispatch takes its work. Software adapters deal workgroups to their threads in contiguous shares,
// and neighbours cost alike: in this order each share, of up to 16, is spread over all of the work.
#define_import_path umbravox::dispatch

// What the workgroup i of n takes: every second one first, each half of those in the same way, four times.
fn spread(i: u32, n: u32) -> u32 {
    var at = i;
    var left = n;
    var first = 0u;
    var stride = 1u;
    for (var halving = 0; halving < 4; halving++) {
        let even = (left + 1u) / 2u;
        let odd = at >= even;
        at -= select(0u, even, odd);
        left = select(even, left - even, odd);
        first += select(0u, stride, odd);
        stride *= 2u;
    }
    return first + at * stride;
}
