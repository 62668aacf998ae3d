#pragma once

#include "model/messages/exchange.hpp"
#include "model/settings/optimisation.hpp"
#include "model/settings/settings.hpp"
#include "rt/histogram.hpp"

#include <nlohmann/json_fwd.hpp>

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace subworld {

using Json = nlohmann::ordered_json;

/// The conversion to JSON and back, which is not in the header.
#define SUBWORLD_HAS_JSON(Type)               \
  void to_json(Json& json, const Type& from); \
  void from_json(const Json& json, Type& to);

/// Of a measured time, s.
struct Quantiles {
  double p50 = 0.0, p99 = 0.0, p99_9 = 0.0, max = 0.0, mean = 0.0;
};
SUBWORLD_HAS_JSON(Quantiles)
[[nodiscard]] Quantiles quantiles(const Histogram& histogram);

/// Time of a loop's stage, over the steps that contain it.
struct StageTime : Quantiles {
  std::string name;
  std::optional<double> share = {};  ///< of the time outside waking up, which has none
};
/// A loop's stages (rt/stages). JSON: {"NAME_s": its times}.
struct StageTimes {
  std::vector<StageTime> all;
};
[[nodiscard]] StageTimes stages(std::span<const Histogram> times, std::span<const char* const> names);
SUBWORLD_HAS_JSON(StageTimes)

/// Mean and maximum of a count. JSON: {"mean", "max"}.
struct MeanMax {
  double sum = 0.0;
  double max = 0.0;
  std::uint64_t count = 0;

  void add(double value) noexcept {
    sum += value;
    max = count == 0 ? value : (value > max ? value : max);
    ++count;
  }
  [[nodiscard]] double mean() const noexcept { return count == 0 ? 0.0 : sum / static_cast<double>(count); }
};
SUBWORLD_HAS_JSON(MeanMax)

/// An exchange of engines while running.
struct EngineChange {
  std::uint32_t order = 0;  ///< number of the `Control` that requested it
  double at_s = 0.0;        ///< simulated time
  std::string from;
  std::string to;
  double exchange_s = 0.0;    ///< time that the loop spent on it
  double force_step_n = 0.0;  ///< largest change of the force on the operator between two steps just after; haptic only
  double force_step_before_n = 0.0;  ///< likewise just before the exchange
};
SUBWORLD_HAS_JSON(EngineChange)
[[nodiscard]] std::string to_text(const EngineChange& change);

/// Middleware events while a loop ran.
SUBWORLD_HAS_JSON(EventCounts)

/// Decision and reason of each item of the plan.
[[nodiscard]] Json to_json(std::span<const PlannedItem> plan);

/// Creates the folder. Throws `Error` (failed) with the cure.
void make_folder(const std::string& folder);
/// Space on the disk for a file of results, taken before it is needed: a disk that fills up meanwhile loses no results.
class ReservedFile {
 public:
  /// Throws `Error` (failed) where there is no space. An empty path: reserves nothing.
  explicit ReservedFile(const std::string& path, std::size_t bytes = 1 << 16);
  /// Returns what write_json() has not used.
  ~ReservedFile();
  ReservedFile(const ReservedFile&) = delete;
  ReservedFile& operator=(const ReservedFile&) = delete;

 private:
  std::string unfinished_;
};

/// Writes the complete file or nothing, into the space that was reserved for it. Makes its folder anew where that was
/// removed. Throws `Error` (failed).
void write_json(const std::string& path, const Json& json);
/// Throws `Error` (failed) if the file is missing or invalid.
[[nodiscard]] Json read_json(const std::string& path);

[[nodiscard]] int machine_cores();
/// Machine, kernel and versions, for the summary.
[[nodiscard]] Json machine();

/// The value of a setting; null where it is not set.
[[nodiscard]] Json json_of(const Setting& setting, Settings& settings, UserSpec& user);

}  // namespace subworld
