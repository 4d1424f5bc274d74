// Stands for the headers that tests share: a precompiled header needs a source.
