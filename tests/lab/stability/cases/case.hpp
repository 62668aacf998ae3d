#pragma once

#include "lab/session/setting.hpp"
#include "lab/stability/search.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// How the error of a measurement is counted.
enum class Compare : std::uint8_t {
  relative,  ///< |measured - expected| / |expected|
  absolute,  ///< |measured - expected|, in the quantity's unit
  at_least,  ///< a limit must reach the expected value: expected / measured, so 1 is the bound
  at_most,   ///< a limit must not exceed the expected value: measured / expected
};

struct Measurement {
  double measured = 0.0;
  std::optional<Bracket> bracket = {};  ///< for a searched limit
};
/// A limit for which a formula gives a value.
[[nodiscard]] inline Measurement limit_at(const Bracket& bracket) { return {bracket.middle(), bracket}; }
/// A limit that must be reached: the largest value that was seen to hold counts.
[[nodiscard]] inline Measurement limit_proven(const Bracket& bracket) { return {bracket.proven(), bracket}; }

/// One case of the stability lab: a row of a table. A new row adds the case to the lab, its page and its help.
struct StabilityCase {
  std::string name;
  std::string group = {};      ///< group of its table
  std::string shows;           ///< one sentence
  std::string parameter = {};  ///< the varied parameter; empty: only the searched limit
  std::string parameter_unit = {};
  std::vector<double> values = {};  ///< of the parameter; one measurement for each
  std::size_t quick_values = 1;     ///< number of first values that are measured with --quick
  std::string quantity;             ///< the measured quantity
  std::string unit;
  std::string formula;
  std::string source;  ///< of the formula or of the reference
  Compare compare = Compare::relative;
  double tolerance = 0.02;  ///< of the error
  std::string why;          ///< reason of the tolerance
  std::function<double(double value)> expected = [](double) { return 0.0; };
  std::function<Measurement(const EngineSetting& setting, double value)> measure;
  bool own_step = false;  ///< the case chooses its steps, so it is measured for one step of the setting only
  bool once = false;      ///< independent of engines: measured once
};

}  // namespace subworld
