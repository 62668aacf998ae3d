#include "haptic_sim/local_model.hpp"

#include "haptic_sim/neighbourhood.hpp"

#include <algorithm>

namespace subworld {

namespace {

/// The proxy lives in the world alone.
class MirroredProxy final : public LocalModel {
 public:
  MirroredProxy(const Scene& scene, std::size_t user)
      : id_(scene.users[user].proxy), proxy_(scene.initial[index(id_)]) {}

  Wrench advance(const Drive& drive, double, double, Indicators&) override { return drive.felt; }
  void change_rate(double before, double after) override { proxy_ = at_rate(proxy_, before, after); }
  void follow(const WorldFrame& frame, const HapticReport*, const Age&) override { (void)reset_from(frame); }
  bool reset_from(const WorldFrame& frame) override {
    others_ = {frame.outside_work_j, frame.bodies_j};
    const auto published_state = std::ranges::find(frame.states, id_, &StampedBody::id);
    if (published_state == frame.states.end()) return false;
    proxy_ = published_state->state;
    return true;
  }
  void describe(HapticReport&) override {}
  BodyState proxy() const override { return proxy_; }
  std::size_t members() const noexcept override { return 0; }
  std::size_t contacts() const noexcept override { return 0; }
  std::uint64_t peers() const noexcept override { return 0; }
  OthersEnergy others() const noexcept override { return others_; }
  LiveEngine* engine() noexcept override { return nullptr; }
  bool reports_afterwards() const noexcept override { return false; }

 private:
  BodyId id_;
  BodyState proxy_;
  OthersEnergy others_;
};

}  // namespace

std::unique_ptr<LocalModel> make_local_model(const Scheme& scheme, const Scene& scene, std::size_t user) {
  if (!scheme.properties.has_sub_worlds) return std::make_unique<MirroredProxy>(scene, user);
  return make_neighbourhood(scheme, scene, user);
}

}  // namespace subworld
