#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>

namespace subworld {
namespace {

Scene shared_scene(const std::string& name, const std::string& scheme, int ratio, double latency_s = 0.0) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml");
  scene.settings.users = static_cast<int>(scene.users.size());
  scene.settings.scheme = scheme;
  scene.settings.set_ratio({ratio, ratio});
  scene.settings.world.substeps = 1;
  scene.settings.delay.up_s = scene.settings.delay.down_s = 0.5 * latency_s;
  return scene;
}

struct Shared {
  std::string scene;
  int ratio;
  double latency_s;
  double most;  ///< RMS error of the worst user
  double budget_ratio = 0.4;
};

class SeveralUsers : public testing::TestWithParam<Shared> {};

// At most two to three times what common/coupling/RESULTS.md reports, but for cells of almost zero.
TEST_P(SeveralUsers, FeelEachOtherThroughWhatTheyShare) {
  const Shared& c = GetParam();
  CoupledRun reference(shared_scene(c.scene, "direct", 1));
  ASSERT_TRUE(reference.run());
  Scene scene = shared_scene(c.scene, "reduced", c.ratio, c.latency_s);
  for (UserSpec& user : scene.users) user.budget_ratio = c.budget_ratio;
  CoupledRun coupled(scene);
  ASSERT_TRUE(coupled.run());
  for (std::size_t u = 0; u < coupled.felt.size(); ++u) {
    EXPECT_LE(force_error(coupled.felt[u].force, reference.felt[u].force, scene.settings.h_s).rms, c.most) << u;
  }
}

// The devices' rates, 1000 Hz in the scene, differ from each other and from that of the haptic steps.
TEST(SeveralUsers, FeelDevicesOfAnyRate) {
  const auto with_rates = [](const std::string& scheme, int ratio) {
    Scene scene = shared_scene("squeeze", scheme, ratio);
    scene.users[0].device.rate_hz = 2500;
    scene.users[1].device.rate_hz = 150;
    return scene;
  };
  CoupledRun reference(with_rates("direct", 1));
  ASSERT_TRUE(reference.run());
  CoupledRun coupled(with_rates("reduced", 4));
  ASSERT_TRUE(coupled.run());
  for (std::size_t u = 0; u < coupled.felt.size(); ++u) {
    EXPECT_LE(force_error(coupled.felt[u].force, reference.felt[u].force, 0.001).rms, 0.005) << u;
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, SeveralUsers,
                         testing::Values(Shared{"devices", 4, 0.0, 0.03}, Shared{"squeeze", 4, 0.0, 0.005},
                                         Shared{"squeeze", 20, 0.0, 0.005}, Shared{"squeeze", 5, 0.02, 0.008},
                                         Shared{"squeeze", 5, 0.1, 0.06}, Shared{"weight", 10, 0.0, 0.001},
                                         Shared{"weight", 5, 0.02, 0.005}, Shared{"carry", 10, 0.0, 0.001},
                                         // The chain to the other user does not fit.
                                         Shared{"squeeze", 4, 0.0, 0.025, 0.1}, Shared{"squeeze", 10, 0.0, 0.025, 0.2},
                                         Shared{"squeeze", 5, 0.02, 0.03, 0.1}),
                         [](const auto& tested) {
                           return tested.param.scene + "_r" + std::to_string(tested.param.ratio) + "_" +
                                  std::to_string(static_cast<int>(1e3 * tested.param.latency_s)) + "_ms_" +
                                  std::to_string(static_cast<int>(100 * tested.param.budget_ratio));
                         });

// Both sub-worlds say the same of the cube that they share: it moves there, not twice as far.
TEST(SeveralUsers, CorrectWhatTheyShareTogetherOnce) {
  const Scene scene = shared_scene("lift", "paper", 4);
  const BodyId cube = std::ranges::find(scene.bodies, "cube", &Body::name)->id;
  const auto position_m = [&](double shift_m) {
    World world(scene);
    world.step();
    for (const std::uint32_t u : {0U, 1U}) {
      const WorldFrame& frame = world.frame(u);
      HapticReport report;
      report.user = UserId{u};
      report.stamp = frame.stamp;
      report.stamp_s = frame.stamp_s;
      report.indicators = {
          .proxy_impulse_n_s = 1.0, .total_impulse_n_s = 1.0, .device_impulse_n_s = 1.0, .proxy_contacts = 1};
      for (const BodyId id : frame.members) {
        report.members.push_back(*std::ranges::find(frame.states, id, &StampedBody::id));
        if (id == cube) report.members.back().state.position.x() += shift_m;
      }
      EXPECT_TRUE(world.receive(std::move(report)));
    }
    world.step();
    return world.engine().state(cube).position.x();
  };
  EXPECT_NEAR(position_m(1e-3) - position_m(0.0), 1e-3, 5e-5);
}

}  // namespace
}  // namespace subworld
