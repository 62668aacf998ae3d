// The world's link to a user: the table of the page, and what each of its rows does.
#include "world_sim/user_link.hpp"
#include "coupling/schemes/scheme.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <string>

namespace subworld {
namespace {

constexpr std::array kStates{"awaited", "present", "held", "joining", "absent"};
constexpr std::array kEvents{"report", "new_report", "two_used", "timeout", "leave"};
constexpr std::array kActions{"", "refuse", "count_anew", "join", "release", "forget"};

TEST(UserLink, ThePageOfTheMessagesShowsTheTableThatRuns) {
  std::ifstream page(std::string(SOURCE_FOLDER) + "/common/wire/README.md");
  std::string text((std::istreambuf_iterator<char>(page)), {});
  for (std::size_t state = 0; state < kStates.size(); ++state) {
    std::string row = std::string("| `") + kStates[state] + "` |";
    for (const Transition& cell : kTransitions[state]) {
      row += std::string(" `") + kStates[static_cast<std::size_t>(cell.to)] + "`";
      const std::string action = kActions[static_cast<std::size_t>(cell.action)];
      row += (action.empty() ? "" : ", `" + action + "`") + " |";
    }
    EXPECT_NE(text.find(row + "\n"), std::string::npos) << row;
  }
}

/// A link whose user pushes with 2 N; cycles of one haptic step's stamps.
class Link {
 public:
  Link() : scene_(load_scene(std::string(SCENES_FOLDER) + "/lift.yaml")), link(scheme_of(scene_.settings), scene_, 0) {}

  bool report(std::uint64_t started = 0) { return report(started, stamp_); }
  /// `confirmed`: the newest frame that the sub-world knows.
  bool report(std::uint64_t started, std::uint64_t confirmed) {
    HapticReport report;
    report.stamp = ++stamp_;
    report.confirmed_stamp = confirmed;
    report.stamp_s = 0.01 * static_cast<double>(stamp_);
    report.started_stamp = started;
    report.impulse_total.force = {0.02 * static_cast<double>(stamp_), 0.0, 0.0};
    return link.receive(report, stamp_, {});
  }
  /// Receives and uses a report. Whether the coupling has let the proxy go.
  bool use(std::uint64_t started = 0) {
    EXPECT_TRUE(report(started));
    EXPECT_NE(link.take(stamp_), nullptr);
    return link.used(stamp_, 0.01 * static_cast<double>(stamp_));
  }
  void reach(UserPresence state) {
    if (state == UserPresence::awaited) return;
    use();
    use();
    if (state == UserPresence::held) link.time_out(stamp_, {});
    if (state == UserPresence::joining) {
      EXPECT_TRUE(report(stamp_));
    }
    if (state == UserPresence::absent) link.leave({}, stamp_ + 1);
    EXPECT_EQ(link.presence(), state);
  }
  /// False where the report is refused.
  bool happen(LinkEvent event) {
    if (event == LinkEvent::report) return report(link.presence() == UserPresence::joining ? 2 : 0);
    if (event == LinkEvent::new_report) return report(stamp_ + 1);
    if (event == LinkEvent::timeout) link.time_out(stamp_, {});
    if (event == LinkEvent::leave) link.leave({}, stamp_ + 1);
    return true;
  }

 private:
  Scene scene_;
  std::uint64_t stamp_ = 0;

 public:
  UserLink link;
};

TEST(UserLink, FollowsEachRowOfTheTable) {
  for (std::size_t state = 0; state < kStates.size(); ++state) {
    for (std::size_t event = 0; event < kEvents.size(); ++event) {
      if (static_cast<LinkEvent>(event) == LinkEvent::two_used) continue;  // below
      SCOPED_TRACE(std::string(kStates[state]) + ", " + kEvents[event]);
      const auto from = static_cast<UserPresence>(state);
      const auto [to, action] = transition(from, static_cast<LinkEvent>(event));
      Link user;
      user.reach(from);
      EXPECT_EQ(user.happen(static_cast<LinkEvent>(event)), action != LinkAction::refuse);
      EXPECT_EQ(user.link.presence(), to);
      EXPECT_EQ(user.link.holds(), to != UserPresence::present || !user.link.reports().heard());
      if (action == LinkAction::forget) {
        EXPECT_FALSE(user.link.reports().heard());
      }
    }
  }
}

TEST(UserLink, TheCouplingHoldsTheProxyUntilTwoReportsOfTheJoinAreUsed) {
  Link user;
  user.reach(UserPresence::absent);
  EXPECT_FALSE(user.use(3));
  EXPECT_TRUE(user.link.holds());
  EXPECT_TRUE(user.use(3));
  EXPECT_EQ(user.link.presence(), UserPresence::present);
  EXPECT_TRUE(user.link.drives());
}

TEST(UserLink, AUserWhoFallsSilentIsHeldWithTheLastWrench) {
  Link user;
  user.reach(UserPresence::held);
  user.link.act(4, 0.04, {}, user.link.spec().coupling);
  EXPECT_NEAR(user.link.wrench().force.x(), 2.0, 1e-9);
}

// The network was down: what the sub-world did meanwhile, the world has undone by holding the proxy.
TEST(UserLink, ReportsThatDoNotKnowThatTheProxyIsHeldArePassedOver) {
  Link user;
  user.reach(UserPresence::held);
  EXPECT_TRUE(user.report(0, 1)) << "it is a sign of life";
  EXPECT_EQ(user.link.presence(), UserPresence::held);
  EXPECT_EQ(user.link.take(3), nullptr);
  EXPECT_TRUE(user.report(0, 2));
  EXPECT_EQ(user.link.presence(), UserPresence::joining);
}

TEST(UserLink, UntilAUserIsHeardTheCouplingHoldsTheProxyAndItsImpulseCounts) {
  Link user;
  BodyState proxy;
  const CouplingSettings& coupling = user.link.spec().coupling;
  proxy.position = Vec3(-0.10, 0, 0.05) - Vec3(2.0 / coupling.stiffness_n_m, 0, 0);
  for (int cycle = 1; cycle <= 3; ++cycle) {
    user.link.act(0, 0.01 * cycle, proxy, coupling);
    EXPECT_NEAR(user.link.wrench().force.x(), 2.0, 1e-9);
  }
  EXPECT_NEAR(user.link.impulse().force.x(), 0.06, 1e-12);
  for (int stamp = 1; stamp <= 4; ++stamp) user.use();
  user.link.act(4, 0.04, proxy, coupling);
  EXPECT_NEAR(user.link.wrench().force.x(), 2.0, 1e-9) << "nothing is exerted twice, nothing is lost";
}

TEST(UserLink, TotalsOfAUserWhoJoinsGoOnFromThoseThatTheWorldHas) {
  Link user;
  user.reach(UserPresence::present);
  user.link.act(2, 0.02, {}, user.link.spec().coupling);
  user.link.leave({}, 3);
  const double passed = user.link.impulse().force.x();
  EXPECT_GT(passed, 0.0);
  user.use(3);
  EXPECT_DOUBLE_EQ(user.link.reports().newest().impulse_total.force.x(), passed);
}

}  // namespace
}  // namespace subworld
