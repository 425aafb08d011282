"""Analysis of gaits and closed loops: singularities, the Two Color Map, statics, stability."""
