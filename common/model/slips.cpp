#include "model/slips.hpp"

#include <fmt/core.h>

#include <array>
#include <cmath>

namespace subworld {

namespace {

struct Suffix {
  std::string_view end;
  std::string_view unit;
};
/// Longer ones first.
constexpr std::array kSuffixes{Suffix{"_n_m_s_rad", "N m s/rad"},
                               Suffix{"_n_m_rad", "N m/rad"},
                               Suffix{"torque_limit_n_m", "N m"},
                               Suffix{"impulse_threshold_n_s", "N s"},
                               Suffix{"deadband", kPartUnit},
                               Suffix{"_kg_m3", "kg/m3"},
                               Suffix{"_kg_m2", "kg m2"},
                               Suffix{"_rad_m", "rad/m"},
                               Suffix{"_rad_s", "rad/s"},
                               Suffix{"_n_s_m", "N s/m"},
                               Suffix{"_m_s2", "m/s2"},
                               Suffix{"_deg_s", "deg/s"},
                               Suffix{"_m_s", "m/s"},
                               Suffix{"_n_m", "N/m"},
                               Suffix{"_n_s", "N/s"},
                               Suffix{"_deg", "deg"},
                               Suffix{"_ratio", kPartUnit},
                               Suffix{"_kg", "kg"},
                               Suffix{"_hz", "Hz"},
                               Suffix{"_n", "N"},
                               Suffix{"_w", "W"},
                               Suffix{"_s", "s"},
                               Suffix{"_m", "m"}};

struct Slip {
  std::string_view unit;   ///< that is wanted
  std::string_view other;  ///< that was meant
  double factor;           ///< from the other one
};
/// Of one unit the likely ones first.
constexpr std::array kSlips{Slip{"s", "ms", 1e-3},
                            Slip{"s", "us", 1e-6},
                            Slip{"m", "mm", 1e-3},
                            Slip{"m", "cm", 1e-2},
                            Slip{"kg", "g", 1e-3},
                            Slip{"Hz", "kHz", 1e3},
                            Slip{"m/s", "mm/s", 1e-3},
                            Slip{"N/m", "N/mm", 1e3},
                            Slip{"deg", "rad", 180.0 / M_PI},
                            Slip{"rad", "deg", M_PI / 180.0},
                            Slip{kPartUnit, "%", 1e-2}};

}  // namespace

std::string to_text(const Limits& limits) {
  std::string text;
  if (std::isfinite(limits.least)) text += fmt::format("{} {}", limits.above ? "above" : "at least", limits.least);
  if (std::isfinite(limits.most)) {
    text += fmt::format("{}{} {}", text.empty() ? "" : " and ", limits.below ? "below" : "at most", limits.most);
  }
  return text;
}

std::string_view unit_of(std::string_view key) {
  if (key.ends_with(']')) key = key.substr(0, key.rfind('['));
  for (const Suffix& suffix : kSuffixes) {
    if (key.ends_with(suffix.end)) return suffix.unit;
  }
  return {};
}

std::string likely_slip(double value, const Limits& limits, std::string_view unit) {
  if (limits.contains(value)) return {};
  for (const Slip& slip : kSlips) {
    if (slip.unit != unit || !limits.contains(slip.factor * value)) continue;
    return fmt::format("; did you mean {:.6g} ({:g} {})?", slip.factor * value, value, slip.other);
  }
  return {};
}

}  // namespace subworld
