"""Rules of selection that keep a population diverse; each ranks or fills cells."""
