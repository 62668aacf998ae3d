// A library that has an engine's file name and exports no engine.
extern "C" __attribute__((visibility("default"))) int nothing_of_an_engine() { return 0; }
