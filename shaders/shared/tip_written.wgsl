// The tip for stages that advance it.
@group(3) @binding(1) var<storage, read_write> tip_state: TipState;
@group(3) @binding(2) var<storage, read_write> tip_anchor_loads: array<TipAnchorLoad>;
