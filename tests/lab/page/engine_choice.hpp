#pragma once

#include "io/results/results.hpp"
#include "lab/page/tables.hpp"

#include <string>
#include <vector>

/// Engines, presets and time steps in the options of the labs that judge engines.
namespace subworld {

/// Display order of the engines: those of the paper first, the others by name.
[[nodiscard]] std::vector<std::string> in_display_order(std::vector<std::string> engines);
/// The requested presets, or every preset of the engine. Throws `Error` (usage) if the engine or a preset does not
/// exist.
[[nodiscard]] std::vector<std::string> presets_of(const std::vector<std::string>& asked, const std::string& engine);
/// Name, version, licence and presets of each.
[[nodiscard]] Json engines_json(const std::vector<std::string>& engines);
/// "bullet (Bullet 3.24), ode (ODE 0.16)"
[[nodiscard]] std::string engines_text(const std::vector<std::string>& engines);

/// Seconds from "1/60" or "0.01". Throws `Error` (usage).
[[nodiscard]] double step_of(const std::string& text);
/// "1/60" if the step is such a fraction, else the seconds.
[[nodiscard]] std::string step_text(double dt_s);

/// Engine and preset of a row.
[[nodiscard]] std::string setting_of(const Json& row);
/// Those of all rows, in their order.
[[nodiscard]] std::vector<std::string> settings_of(const Rows& rows);

}  // namespace subworld
