#pragma once

#include "coupling/tool/impulse_account.hpp"
#include "world_sim/report_inbox.hpp"

#include <array>
#include <cstdint>
#include <span>

namespace subworld {

/// Whether a user takes part, as the world sees it. In all states but `present` the virtual coupling holds the proxy,
/// with the wrench that the user exerted last: nothing falls that was held, and nothing is pushed on.
enum class UserPresence : std::uint8_t {
  awaited,  ///< no report has come since the start; the device is where the proxy starts
  present,  ///< the reports act on the proxy
  held,     ///< no report comes
  joining,  ///< reports of another start come; two of them must be used: their difference is what the user does now
  absent,   ///< the user has left; reports of before are refused
  count
};

enum class LinkEvent : std::uint8_t {
  report,      ///< comes, of the start of the sub-world that is known
  new_report,  ///< comes, of a sub-world that has started from a newer frame
  two_used,    ///< the second report since the join has been used
  timeout,     ///< no report has come for too long
  leave,       ///< by order, as planned, or after a longer timeout
  count
};

enum class LinkAction : std::uint8_t {
  none,
  refuse,      ///< the report is not used
  count_anew,  ///< totals that the sub-world has counted for another world are taken off
  join,        ///< the totals go on from those that the world has
  release,     ///< the coupling no longer holds the proxy
  forget       ///< reports that wait, the suppression, corrections under way
};

struct Transition {
  UserPresence to;
  LinkAction action = LinkAction::none;
};

using Transitions = std::array<std::array<Transition, static_cast<std::size_t>(LinkEvent::count)>,
                               static_cast<std::size_t>(UserPresence::count)>;

/// By state and event. The page of the messages shows this table (common/wire/README.md).
inline constexpr Transitions kTransitions = [] {
  using enum UserPresence;
  using A = LinkAction;
  constexpr Transition kJoin{joining, A::join}, kLeave{absent, A::forget};
  return Transitions{{
      // report, new_report, two_used, timeout, leave
      {{{present, A::count_anew}, kJoin, {awaited}, {held}, kLeave}},
      {{{present}, kJoin, {present}, {held}, kLeave}},
      {{kJoin, kJoin, {held}, {held}, kLeave}},
      {{{joining}, kJoin, {present, A::release}, {held}, kLeave}},
      {{{absent, A::refuse}, kJoin, {absent}, {absent}, kLeave}},
  }};
}();

[[nodiscard]] constexpr const Transition& transition(UserPresence from, LinkEvent event) noexcept {
  return kTransitions[static_cast<std::size_t>(from)][static_cast<std::size_t>(event)];
}

/// The world's link to one user: the reports, the presence, what the totals of the reports count from, and the wrench
/// of the user on the proxy. `proxy` is the state of the world's proxy.
class UserLink {
 public:
  UserLink(const Scheme& scheme, const Scene& scene, std::size_t user);

  /// Keeps a report until the world, which is at the stamp `now`, reaches its stamp. False for one that is refused. The
  /// caller gets an older report for it, so that a reader need not allocate for the next one. One of a sub-world that
  /// does not know yet that the world holds the proxy is passed over: it would move bodies by what the world has
  /// undone.
  bool receive(HapticReport& report, std::uint64_t now, const BodyState& proxy);
  /// See ReportInbox.
  [[nodiscard]] const HapticReport* take(std::uint64_t stamp) noexcept { return inbox_.take(stamp); }
  /// What take() returned has been used, for the motion up to `until_s`. True where the coupling holds the proxy no
  /// longer.
  bool used(std::uint64_t stamp, double until_s);
  /// No report has come for too long until the stamp `now`.
  void time_out(std::uint64_t now, const BodyState& proxy) {
    if (!holds()) held_at_ = now;
    follow(LinkEvent::timeout, proxy);
  }
  /// From now on only reports count of a sub-world that has started from a frame of `joins_from` or later.
  void leave(const BodyState& proxy, std::uint64_t joins_from);
  /// In a resumed world: the coupling holds the proxy from there, with energy of before.
  void hold_at(const Pose& device, const BodyState& proxy);
  /// Finds the wrench() of the cycle that ends at `until_s`, of which the report has this stamp.
  void act(std::uint64_t stamp, double until_s, const BodyState& proxy, const CouplingSettings& coupling);
  void begin_suppression(const WorldFrame& frame) noexcept { inbox_.begin_suppression(frame); }
  /// By which the copies of the world and of the sub-world become one, from the frame and the report of one stamp. What
  /// the sub-world makes of this frame is not known here: as if it were too old to correct anything.
  [[nodiscard]] std::span<const PairShift> shifts(const WorldFrame& frame, const HapticReport& report) {
    return synchroniser_.synchronise(frame, report, INFINITY);
  }

  [[nodiscard]] const UserSpec& spec() const noexcept { return spec_; }
  [[nodiscard]] const ReportInbox& reports() const noexcept { return inbox_; }
  [[nodiscard]] UserPresence presence() const noexcept { return presence_; }
  /// The coupling holds the proxy.
  [[nodiscard]] bool holds() const noexcept { return holds(presence_) || awaits(); }
  /// No report has been used since the start. One may have come before the simulated time at which it counts.
  [[nodiscard]] bool awaits() const noexcept { return presence_ <= UserPresence::present && !inbox_.heard(); }
  /// The reports act on the proxy.
  [[nodiscard]] bool drives() const noexcept { return inbox_.heard() && !holds(); }
  /// Where the device is that exerts the wrench of the last cycle on a proxy at rest.
  [[nodiscard]] DevicePose device(const BodyState& proxy) const;
  /// Of the user on the proxy, mean over the cycle under way.
  [[nodiscard]] const Wrench& wrench() const noexcept { return wrench_; }
  /// Impulse of the user that has been passed on to the world, since the start.
  [[nodiscard]] const Wrench& impulse() const noexcept { return impulse_.applied(); }

 private:
  /// What a report counts since the start.
  struct Totals {
    Wrench impulse;
    double device_work_j = 0.0, operator_work_j = 0.0;
  };
  [[nodiscard]] static constexpr bool holds(UserPresence presence) noexcept {
    return presence != UserPresence::present;
  }
  LinkAction follow(LinkEvent event, const BodyState& proxy);
  void join(const HapticReport& report, const BodyState& proxy) noexcept;
  void count_anew(const HapticReport& report) noexcept;
  [[nodiscard]] double stored_j(const BodyState& proxy) const noexcept;

  const UserSpec& spec_;
  ReportInbox inbox_;
  UserPresence presence_ = UserPresence::awaited;
  DevicePose device_;                 ///< while the coupling holds the proxy
  std::uint64_t held_at_ = 0;         ///< stamp at which reports of a present user had stayed away
  std::uint64_t joins_from_ = 1;      ///< oldest frame of another start of the sub-world
  std::uint64_t joins_at_ = 0;        ///< stamp of the first report of the user who is joining
  Totals baseline_;                   ///< added to those of reports: a process that joins counts from its own start
  bool counted_for_another_ = false;  ///< the totals of the first report: they begin where the world is
  ImpulseAccount impulse_;
  Wrench wrench_;
  Synchroniser synchroniser_;
};

}  // namespace subworld
