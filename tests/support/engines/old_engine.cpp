// An engine's library of another build: its interface number differs from that of the programs.
#include "physics/plugin.hpp"

extern "C" {
__attribute__((visibility("default"))) const subworld::EnginePlugin* subworld_engine_plugin() { return nullptr; }
__attribute__((visibility("default"))) int subworld_engine_plugin_interface() {
  return subworld::kEnginePluginInterface - 1;
}
__attribute__((visibility("default"))) const char* subworld_engine_plugin_compiler() { return __VERSION__; }
}
