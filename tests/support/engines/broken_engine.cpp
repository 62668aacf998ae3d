// A library with the file name of an engine that exports no engine.
extern "C" __attribute__((visibility("default"))) int nothing_of_an_engine() { return 0; }
