// The tip for stages that only read it.
@group(3) @binding(1) var<storage, read> tip_state: TipState;
@group(3) @binding(2) var<storage, read> tip_anchor_loads: array<TipAnchorLoad>;
