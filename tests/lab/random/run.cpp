#include "lab/random/run.hpp"

#include "io/results/json.hpp"
#include "lab/page/command_line.hpp"
#include "lab/page/engine_choice.hpp"
#include "lab/random/scene.hpp"
#include "lab/random/scene_text.hpp"
#include "lab/random/shrink.hpp"
#include "lab/session/apart.hpp"
#include "lab/session/operator_bed.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>

namespace subworld {

namespace {

using Clock = std::chrono::steady_clock;
constexpr double kTouching_m = 1e-5;  ///< m, overlap that counts as contact only

/// Prints a line at intervals, and one for each failure.
class Progress {
 public:
  explicit Progress(std::size_t planned) : planned_(planned), left_(static_cast<double>(planned)) {}

  void after(const EngineSetting& setting, const Verdict& verdict) {
    constexpr std::chrono::seconds kEvery{5};
    if (setting.name() != setting_) counts_ = {};
    setting_ = setting.name();
    ++counts_[static_cast<std::size_t>(verdict.fault)];
    ++done_;
    if (Clock::now() - shown_ < kEvery && done_ < planned_) return;
    shown_ = Clock::now();
    std::string faults;
    for (std::size_t i = 1; i < counts_.size(); ++i) {
      if (counts_[i] > 0) faults += fmt::format(", {} {}", counts_[i], kFaultNames[i]);
    }
    fmt::print("[{:5}/{}] {}: {} held{}{}\n", done_, planned_, setting_, counts_[0], faults,
               left_.text(static_cast<double>(done_)));
    std::fflush(stdout);
  }

 private:
  std::size_t planned_, done_ = 0;
  TimeLeft left_;
  std::string setting_;
  std::array<int, std::size(kFaultNames)> counts_{};
  Clock::time_point shown_ = Clock::now();
};

std::string file_name(const Scene& scene, const EngineSetting& setting) {
  return fmt::format("{}_{}_{}", scene.name, setting.engine, setting.preset);
}

Json row_of(const RandomRequest& request, int number, const EngineSetting& setting, const Scene& scene,
            const Verdict& v) {
  const Settings& s = scene.settings;
  return {{"seed", request.seed},
          {"scene", number},
          {"engine", setting.engine},
          {"preset", setting.preset},
          {"scheme", s.scheme},
          {"ratio", s.ratio},
          {"ratio_most", s.largest_ratio()},
          {"users", scene.users.size()},
          {"bodies", scene.bodies.size()},
          {"delayed", s.delay.any()},
          {"duration_s", s.duration_s},
          {"fault", kFaultNames[static_cast<std::size_t>(v.fault)]},
          {"reason", v.reason},
          {"at_s", v.at_s},
          {"energy_gain_ratio", v.gain},
          {"unexplained_j", v.unexplained_j},
          {"put_in_j", v.put_in_j},
          {"users_j", v.users_j},
          {"corrected_j", v.corrected_j},
          {"released_j", v.released_j},
          {"operator_energy_j", v.at_operator_j},
          {"force_max_n", v.force_n},
          {"cpu_s", v.seconds},
          {"run_hash", v.hash},
          {"bounces", false},
          {"file", ""}};
}

/// Shrinks a failing scene and saves it. A smaller scene counts as the same failure if its fault is the same and, for
/// energy, if it gains at least a quarter as much. Otherwise another, smaller cause could replace the first.
void keep(const RandomRequest& request, Scene scene, const Verdict& verdict, const std::string& work, Json& row) {
  constexpr double kSameWay = 0.25;
  const Apart overlap = apart(request.most_s, [&]() -> Json { return deepest_overlap(scene).depth_m; });
  const double most_overlap_m = std::max(kTouching_m, overlap.answer ? overlap.answer->get<double>() : 0.0);
  scene = shrunk(std::move(scene), [&](const Scene& smaller) {
    const Verdict other = judged_apart(smaller, work, request.most_s, most_overlap_m);
    return other.fault == verdict.fault &&
           (other.fault != Fault::energy || other.gain >= std::min(1.0, kSameWay * verdict.gain));
  });
  const Verdict last = judged_apart(scene, work, request.most_s, INFINITY);
  scene.description += fmt::format(" Shrunk: {}.", last.reason);
  row["file"] = write_scene(scene, request.out + "/failures");
  row["bounces"] = std::ranges::any_of(scene.bodies, [](const Body& b) { return b.material.restitution > 0.0; });
}

void print_details(const Json& row) {
  for (const auto& [key, value] : row.items()) fmt::print("  {:<18} {}\n", key, value.dump());
}

}  // namespace

std::vector<EngineSetting> random_settings(const std::vector<std::string>& engines,
                                           const std::vector<std::string>& presets) {
  std::vector<EngineSetting> settings;
  for (const std::string& engine : engines) {
    for (const std::string& preset : presets_of(presets, engine)) settings.push_back({engine, preset});
  }
  return settings;
}

Verdict judged_apart(const Scene& scene, const std::string& folder, double most_s, double most_overlap_m) {
  const Apart run = apart(most_s, [&] {
    const bool any = std::isinf(most_overlap_m);
    Verdict unfit;
    try {
      const Scene read = as_written(scene, folder);
      if (any || deepest_overlap(read).depth_m <= most_overlap_m) return to_json(judged(read));
    } catch (const std::exception& wrong) {
      unfit.fault = any ? Fault::exception : Fault::none;
      unfit.reason = fmt::format("exception: {}", wrong.what());
    }
    return to_json(unfit);
  });
  if (run.answer) return verdict_of(*run.answer);
  Verdict verdict;
  verdict.fault = Fault::crash;
  verdict.reason = fmt::format("crash: {}", run.end);
  return verdict;
}

Rows random_rows(const RandomRequest& request) {
  const std::string work = request.out + "/work";
  const int first = request.only.value_or(0), last = request.only ? first + 1 : request.scenes;
  Progress progress(request.settings.size() * static_cast<std::size_t>(last - first));
  Rows rows;
  try {
    for (const EngineSetting& setting : request.settings) {
      for (int i = first; i < last; ++i) {
        Scene scene = in_engine(random_scene(request.seed, static_cast<std::uint64_t>(i)), setting);
        scene.name = file_name(scene, setting);
        const Verdict verdict = judged_apart(scene, work, request.most_s, INFINITY);
        Json& row = rows.emplace_back(row_of(request, i, setting, scene, verdict));
        if (verdict.fault != Fault::none || request.only) {
          fmt::print("{}, scene {} of seed {}: {}\n", setting.name(), i, request.seed,
                     verdict.fault == Fault::none ? "holds" : verdict.reason);
          std::fflush(stdout);
        }
        if (verdict.fault != Fault::none) {
          keep(request, scene, verdict, work, row);
          fmt::print("  saved as {}; repeat with: --random --seed {} --scene-index {} --engine {} --preset {}\n",
                     row.at("file").get<std::string>(), request.seed, i, setting.engine, setting.preset);
        }
        if (request.only) print_details(row);
        progress.after(setting, verdict);
      }
    }
  } catch (const Interrupted&) {
  }
  std::error_code ignored;
  std::filesystem::remove_all(work, ignored);
  return rows;
}

}  // namespace subworld
