#include "haptic_sim/loops/run.hpp"
#include "model/error.hpp"
#include "program/join.hpp"

#include <fmt/core.h>

#include <optional>

namespace subworld {

namespace {

constexpr double kDiscovery_s = 0.3;  ///< for the programs of a run under way to find those that join it
constexpr double kAgain_s = 0.5;      ///< between two requests to take part

/// A haptic process asks to take part, and waits for the frame from which its sub-world begins.
class LockstepStart : HapticRun {
 public:
  explicit LockstepStart(const HapticRun& run) : HapticRun(run) {}

  std::optional<FirstFrame> wait() {
    if (!find_peer_devices()) return std::nullopt;
    const auto begins = [this] {
      if (!look()) ask();
      return began_;
    };
    const auto settles = [this] { return ports.world_lives(); };  // a living world may take its time
    const Wanted frame{"frame of the world", "every user's haptic_sim and device_sim"};
    if (!wait_for(*ports.bus, options, frame, begins, settles)) return std::nullopt;
    ports.frames.trust_sender();
    ports.status.enter("running");
    return first_;
  }

 private:
  /// Each state of the others' devices counts from the first on. In a run under way, those count that are there.
  bool find_peer_devices() {
    if (!scheme().replicates_peers) return true;
    int present = 0;
    for (std::size_t u = 0; u < scene.users.size(); ++u)
      present += takes_part(scene.settings.presence, static_cast<int>(u), 0.0) ? 1 : 0;
    for (std::uint32_t u = 0; u < scene.users.size(); ++u) {
      if (u == user() || !takes_part(scene.settings.presence, static_cast<int>(u), 0.0)) continue;
      const Wanted device{fmt::format("device of user {}", u), fmt::format("device_sim --user {}", u)};
      const auto there = [&] {
        const bool matched = ports.all_devices->matched() >= present;
        if (look() || (matched && ports.status.met(ProgramKind::device_sim, u))) return true;
        return is_late() && (matched || is_settled());
      };
      if (!wait_for(*ports.bus, options, device, there)) return false;
    }
    return true;
  }

  /// Whether the frame that decides has come: the first one, or the last one of the run.
  bool look() {
    finder.look(options.network.domain);
    ports.session = finder.session();  // of the newest world
    while (!began_ && ports.frames.take(first_.frame) == Take::sample) {
      if (first_.frame.session == ports.session) consider(first_.frame);
    }
    // A last frame may also be that of a user who has left.
    const bool over =
        ports.status.has_ended(ProgramKind::world_sim, 0) || !ports.status.hears(ProgramKind::world_sim, 0);
    if (!began_ && last_ && over) {
      if (ports.serves_another(*last_)) refuse();
      first_.frame = *last_;
      began_ = true;
    }
    return began_;
  }

  void consider(const WorldFrame& frame) {
    first_.received = Clock::now();
    last_.reset();
    if (frame.last) {
      last_ = frame;
    } else if (ports.serves_another(frame)) {
      // Of a process that was killed, there may still be frames.
      if (ports.status.runs(ProgramKind::haptic_sim, user())) refuse();
    } else if (frame.real_time_factor > 0.0) {
      began_ = frame.served == ports.identity && sub.reset_from(frame);
    } else {
      standing_ = frame;
      if (frame.stamp > 0 && late_since_ == TimePoint{}) late_since_ = first_.received;
    }
  }
  [[noreturn]] static void refuse() { throw Error(ExitCode::failed, displaced_text(ProgramKind::world_sim, 0)); }

  void ask() {
    // The world may have been busy with another process: it sends standing frames again, for whoever is there.
    const bool asked = asked_at_ != TimePoint{} && to_seconds(Clock::now() - asked_at_) < kAgain_s;
    if (!standing_ || standing_->session != ports.session || asked || !is_settled()) return;
    HapticReport request;
    request.user = UserId{user()};
    request.stamp = request.started_stamp = standing_->stamp;
    request.confirmed_stamp = request.stamp + 1;  // see asks_to_take_part()
    request.stamp_s = standing_->stamp_s;
    request.sent_ns = to_ns(Clock::now());
    if (ports.send(request)) asked_at_ = Clock::now();
    standing_.reset();
  }

  /// The run is under way.
  [[nodiscard]] bool is_late() const noexcept { return late_since_ != TimePoint{}; }
  [[nodiscard]] bool is_settled() const noexcept {
    return !is_late() || to_seconds(Clock::now() - late_since_) > kDiscovery_s;
  }

  FirstFrame first_;
  std::optional<WorldFrame> standing_, last_;  ///< the newest ones; `last_` only while no other has followed
  TimePoint late_since_{}, asked_at_{};
  bool began_ = false;
};

}  // namespace

std::optional<FirstFrame> begin_lockstep(const HapticRun& run) { return LockstepStart(run).wait(); }

}  // namespace subworld
