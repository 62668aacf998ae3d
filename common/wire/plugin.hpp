#pragma once

#include "wire/backend.hpp"
#include "wire/bus.hpp"

/// Start-up work of the bus that needs no vendor.
namespace subworld::wire {

/// Checks domain, interface and peers, resolves host names and finds the settings file. Throws `Error` (middleware).
[[nodiscard]] Opening prepare(const BusConfig& config);

/// Loads the vendor's plug-in from $SUBWORLD_PLUGIN_DIR or from the program's folder. Throws `Error` (middleware) that
/// names the missing file and its package.
[[nodiscard]] OpenBackend load_plugin(Vendor vendor);

/// The version of a vendor whose plug-in can be loaded; empty: it cannot.
[[nodiscard]] std::string installed_version(Vendor vendor);

}  // namespace subworld::wire
