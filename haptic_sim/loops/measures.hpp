#pragma once

#include "coupling/safety/oscillation.hpp"
#include "coupling/tool/virtual_coupling.hpp"
#include "haptic_sim/sub_world.hpp"
#include "io/results/program_results.hpp"
#include "program/loop_measures.hpp"

#include <array>
#include <optional>
#include <utility>

namespace subworld {

enum class HapticStage : std::uint8_t {
  wake,
  receive,
  decode,
  synchronise,
  control,
  feel,
  send,
  advance,
  report,
  account,
  count
};
inline constexpr std::array kHapticStages{"wake", "receive", "decode",  "synchronise", "control",
                                          "feel", "send",    "advance", "report",      "account"};
static_assert(kHapticStages.size() == Stages<HapticStage>::kCount);

/// What a haptic process says of itself at the end, and its history on the way.
class HapticMeasures : public LoopMeasures<HapticStage> {
 public:
  /// Throws `Error` (failed) for a file of --out or --trace that cannot be written.
  HapticMeasures(const Options& options, const Scene& scene, const History::Say& say);

  /// The world serves this program. Before, it writes nothing: its folder may hold the history of one that was killed.
  void accepted() noexcept {
    accepted_ = true;
    history_.release();
  }
  /// This program takes the place of one that has died.
  void joins_late() noexcept { history_.append(); }
  [[nodiscard]] bool is_accepted() const noexcept { return accepted_; }

  /// After every step.
  void step(const SubWorld& sub, const FeltStep& felt, const StepTimes& times) noexcept;
  /// Closes the step's stages: the last of all.
  void end_step() noexcept;
  /// Periods that were over before their steps could begin: missed deadlines, and no steps. `by_os`: of these.
  void skipped(int periods, int by_os) noexcept;
  void synchronised(double seconds, std::uint64_t lost_frames) noexcept;
  /// A frame has come; the world lacked the report of its stamp.
  void framed(bool lacked_report) noexcept {
    ++frames_;
    lacked_reports_ += lacked_report ? 1 : 0;
  }
  void resynchronised() noexcept { ++resets_; }
  /// Share of the commands that were sent.
  void sent(double ratio) noexcept { sent_ratio_ = ratio; }
  /// A frame whose stamp no world has that goes on from the last one.
  void refused_frame() noexcept { ++refused_frames_; }
  /// The engine has just been exchanged; what the force does in the next steps is added to it.
  void engine_changed(const EngineChange& change);
  /// A change whose effect on the force is known by now, once.
  [[nodiscard]] std::optional<EngineChange> take_settled_change() {
    return std::exchange(settled_change_, std::nullopt);
  }

  /// What the status shows; missed deadlines with those of the skipped steps.
  [[nodiscard]] LoopState state(double time_s) const noexcept {
    return LoopMeasures::state(time_s, last_force_.norm(), 1.0);
  }

  /// After the last step.
  [[nodiscard]] HapticResult result(const SubWorld& sub, double bytes_per_cycle);

 private:
  int user_;
  bool accepted_ = false;
  double sent_ratio_ = 1.0;
  double newest_members_ = 0.0;
  bool missed_ = false, lost_ = false;  ///< a deadline and frames, in the present step
  Histogram sync_;
  MeanMax members_, contacts_, border_;
  std::uint64_t frames_ = 0, lacked_reports_ = 0;
  std::uint64_t skipped_ = 0, lost_frames_ = 0, resets_ = 0, refused_frames_ = 0;
  int skipped_before_step_ = 0;
  ForceLimits limits_;
  double h_s_;
  MeanMax operator_squared_, coupling_squared_;  ///< force sent to the device and of the coupling, N^2
  MeanMax at_limit_;                             ///< 1 in a step with all that the device can give
  double apart_m_ = 0.0;                         ///< proxy and device, at most

  static constexpr std::size_t kForceStepWindow = 20;  ///< haptic steps before and after a change of engine
  void watch_force(const Vec3& force) noexcept;
  void settle_change();
  Vec3 last_force_ = Vec3::Zero();
  std::array<double, kForceStepWindow> force_steps_{};  ///< N, between two commands; the newest ones
  OscillationWatch oscillation_;
  MeanMax force_step_;  ///< N, all of them
  std::optional<EngineChange> open_change_, settled_change_;
  std::uint64_t change_settles_at_ = 0;  ///< step
  std::vector<EngineChange> engine_changes_;
};

}  // namespace subworld
