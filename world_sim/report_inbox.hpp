#pragma once

#include "coupling/messages/suppression.hpp"
#include "coupling/plan.hpp"
#include "coupling/sync/synchroniser.hpp"
#include "model/messages/exchange.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace subworld {

/// The reports of one user: those that wait until the world reaches their stamps, and the two that were used last.
/// Counts which messages do not come during message suppression.
class ReportInbox {
 public:
  ReportInbox(const Scheme& scheme, const Scene& scene)
      : remembered_(remembered_cycles(scene.settings, scheme)),
        // A suppression ends with a report that is so much ahead.
        slots_(remembered_ + (enabled(scene, Optimisation::suppression) ? kMostSuppressedCycles : 0)),
        waiting_(slots_.size()),
        suppression_(scheme.properties.lead_cycles) {
    if (scene.settings.mode == Mode::realtime) {
      for (HapticReport& report : slots_) reserve(report, kUsualMembers);
    }
    reserve(newest_, kUsualMembers);
    reserve(before_, kUsualMembers);
  }

  /// Whether a world that is at the stamp `now` can use a report of this stamp: not one that is too old, or too far
  /// ahead.
  [[nodiscard]] bool accepts(std::uint64_t stamp, std::uint64_t now) const noexcept {
    if (heard_ && stamp <= newest_.stamp) return false;
    return stamp <= now + slots_.size() - remembered_ / 2 && stamp + remembered_ > now;
  }
  /// Keeps a report; the caller gets an older one's memory for it.
  void put(HapticReport& report) noexcept {
    const std::uint64_t stamp = report.stamp;
    std::swap(slots_[slot(stamp)], report);
    waiting_[slot(stamp)] = true;
    newest_stamp_ = std::max(newest_stamp_, stamp);
    suppression_.end(stamp);
  }
  /// The report of this stamp that is to be used now; null where none waits, or a newer one has been used.
  [[nodiscard]] const HapticReport* take(std::uint64_t stamp) noexcept {
    if (!holds(stamp)) return nullptr;
    waiting_[slot(stamp)] = false;
    return heard_ && stamp <= newest_.stamp ? nullptr : &slots_[slot(stamp)];
  }
  /// What take() returned has been used.
  void used(std::uint64_t stamp) noexcept {
    std::swap(before_, newest_);
    std::swap(newest_, slots_[slot(stamp)]);
    heard_ = true;
  }
  /// The user has left: the reports that come next are of another sub-world.
  void forget() {
    heard_ = false;
    newest_stamp_ = 0;
    waiting_.assign(waiting_.size(), false);
    suppression_.forget();
  }
  /// A frame of the present stamp, which both sides use.
  void begin_suppression(const WorldFrame& frame) noexcept { suppression_.begin(frame); }

  /// A report has been used, of the sub-world that takes part now.
  [[nodiscard]] bool heard() const noexcept { return heard_; }
  /// The report of this stamp waits, or will not come.
  [[nodiscard]] bool has(std::uint64_t stamp) const noexcept {
    return holds(stamp) || suppression_.lacks_report(stamp);
  }
  [[nodiscard]] bool waits_for_frame(std::uint64_t stamp) const noexcept { return !suppression_.lacks_frame(stamp); }
  [[nodiscard]] const HapticReport& newest() const noexcept { return newest_; }  ///< that was used
  [[nodiscard]] HapticReport& newest() noexcept { return newest_; }
  [[nodiscard]] const HapticReport& before() const noexcept { return before_; }  ///< the one used before it
  /// The report of a stamp, or the one that ends the suppression in which it lies, or the newest used.
  [[nodiscard]] const HapticReport& at(std::uint64_t stamp) const noexcept {
    while (suppression_.lacks_report(stamp)) ++stamp;
    return holds(stamp) ? slots_[slot(stamp)] : newest_;
  }
  [[nodiscard]] const HapticReport& before(const HapticReport& now) const noexcept {
    return &now == &newest_ ? before_ : newest_;
  }
  [[nodiscard]] std::uint64_t newest_stamp() const noexcept { return newest_stamp_; }  ///< received, used or not

 private:
  [[nodiscard]] std::size_t slot(std::uint64_t stamp) const noexcept { return stamp % slots_.size(); }
  [[nodiscard]] bool holds(std::uint64_t stamp) const noexcept {
    return waiting_[slot(stamp)] && slots_[slot(stamp)].stamp == stamp;
  }

  std::uint64_t remembered_;
  std::vector<HapticReport> slots_;  ///< by stamp
  std::vector<bool> waiting_;        ///< by slot: its report is not used yet
  HapticReport newest_, before_;
  bool heard_ = false;
  std::uint64_t newest_stamp_ = 0;
  SuppressedCycles suppression_;
};

}  // namespace subworld
