#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace subworld {

/// How the delay of a packet varies around its mean, as in `tc netem`: delay + jitter t.
enum class JitterShape : std::uint8_t {
  uniform,  ///< t even in -1 .. 1: `jitter` is the largest difference
  normal,   ///< t normal, cut off at 4: `jitter` is the standard deviation
  pareto,  ///< t = 4/3 (u^(-1/3) - 3/2), cut off at 4: a long tail of late packets; mean -0.03, standard deviation 0.82
};

/// Loss of packets after Gilbert (1960) and Elliott (1963): a chain of a good and a bad state, one step a packet. The
/// defaults lose nothing. Independent loss of a ratio L is `{.loss_in_good = L}`.
struct LossModel {
  double p = 0.0;             ///< probability of good to bad
  double r = 1.0;             ///< probability of bad to good
  double loss_in_bad = 1.0;   ///< 1-h in netem
  double loss_in_good = 0.0;  ///< 1-k in netem

  /// Share of the packets that meet the bad state: p / (p + r).
  [[nodiscard]] double bad_ratio() const noexcept { return p > 0.0 ? p / (p + r) : 0.0; }
  [[nodiscard]] double loss_ratio() const noexcept {
    return bad_ratio() * loss_in_bad + (1.0 - bad_ratio()) * loss_in_good;
  }
  bool operator==(const LossModel&) const = default;
};

/// A time in which a link delivers nothing, s since the link started. Packets on their way still arrive.
struct Outage {
  double from_s = 0.0;
  double for_s = 0.0;    ///< 0: no outage
  double every_s = 0.0;  ///< again after each such time; 0: once

  [[nodiscard]] bool holds(double t_s) const noexcept;
  bool operator==(const Outage&) const = default;
};

/// One direction of a link. The defaults are an ideal link.
struct LinkSettings {
  double delay_s = 0.0;  ///< one way
  double jitter_s = 0.0;
  JitterShape shape = JitterShape::uniform;
  LossModel loss;
  double duplicate_ratio = 0.0;
  double reorder_ratio = 0.0;  ///< share of the packets that are not delayed and so overtake others
  int reorder_gap = 1;         ///< at least so many packets from one that overtakes to the next
  double rate_bit_s = 0.0;     ///< of IP packets; 0: no limit
  int limit = 1000;            ///< packets that are on their way or wait; more are dropped
  Outage outage;

  bool operator==(const LinkSettings&) const = default;
};

/// A named link.
struct LinkPreset {
  const char* name;
  const char* text;  ///< as `parse_link` reads it; one way, equal in both directions
  const char* about;
};
[[nodiscard]] std::span<const LinkPreset> link_presets() noexcept;

/// Reads the options of `tc netem` and the names of presets; a later word wins over an earlier one:
///   PRESET, delay TIME [TIME], jitter TIME, distribution uniform|normal|pareto, loss [random] RATIO,
///   loss gemodel P [R [1-H [1-K]]], duplicate RATIO, reorder RATIO [gap N], rate RATE, limit N,
///   outage from TIME for TIME [every TIME].
/// A TIME has its unit (`20ms`), a RATIO is in percent (`2%`), a RATE in bits a second (`10mbit`). Throws `Error`
/// (usage) with the word, the fault and the cure.
[[nodiscard]] LinkSettings parse_link(const std::string& text);

/// The text from which `parse_link` reads equal settings; "ideal" is the text of the defaults.
[[nodiscard]] std::string to_text(const LinkSettings& settings);

}  // namespace subworld
