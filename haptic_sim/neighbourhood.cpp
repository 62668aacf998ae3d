#include "haptic_sim/neighbourhood.hpp"

#include "coupling/plan.hpp"
#include "coupling/safety/energy_port.hpp"
#include "coupling/select/selection.hpp"
#include "coupling/sync/authority.hpp"
#include "coupling/sync/gradual_shifts.hpp"
#include "coupling/sync/synchroniser.hpp"
#include "haptic_sim/bodies_energy.hpp"
#include "haptic_sim/peer_forecast.hpp"
#include "model/surfaces.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr double kSlower = 1.001;   ///< of the haptic step: from there on a device is slower
constexpr double kSameTime = 1e-6;  ///< of a device's period

/// A copy of the neighbourhood in an engine of its own, with the outside at its border.
class SimulatedNeighbourhood final : public LocalModel {
 public:
  SimulatedNeighbourhood(const Scheme& scheme, const Scene& scene, std::size_t user)
      : scheme_(scheme),
        scene_(scene),
        proxy_(scene.users[user].proxy),
        engine_(make_engine(scene.settings.haptic, scene.meshes)),
        synchroniser_(scheme, scene, user),
        bodies_energy_(scene),
        has_driven_surfaces_(has_driven_surfaces(scene)),
        reads_friction_(!enabled(scene, Optimisation::impulses)),
        border_(scheme.make_sub_world_side(scene, remembered_cycles(scene.settings, scheme))) {
    engine_.set_joints(scene.joints);
    for (std::vector<BodyId>* list : {&members_, &fixed_, &scratch_}) list->reserve(kUsualMembers);
    peers_.reserve(scene.users.size());
    for (const UserSpec& of : scene.users) peer_work_.emplace_back(of.device.kind);
    forecasts_.resize(scene.users.size());
    pulls_.reserve(scene.users.size());
    outside_pulls_.reserve(scene.users.size());
  }

  Wrench advance(const Drive& drive, double time_s, double dt, Indicators& indicators) override {
    Wrench mean = drive.felt;
    gradual_.step(engine_);
    const Wrench& pressed = drive.kind == DeviceKind::admittance ? drive.applied : drive.felt;
    pulls_.clear();
    const double peers_n = move_peers(drive.peers, time_s, dt);
    border_->begin(engine_, dt, pressed.force.norm() + peers_n, outside_pulls_);
    if (drive.kind == DeviceKind::admittance) {
      engine_.apply_force(proxy_, drive.applied.force, drive.applied.torque);
    } else {
      // What is in the coupling at the start was put in by nobody.
      if (!std::exchange(begun_, true))
        others_work_j_ += coupling_energy(drive.tool.coupling, drive.limits, proxy(), drive.device);
      pull(drive.tool, drive.limits, drive.device, dt);
    }
    engine_.step(dt);
    for (const Pull& by : pulls_) {
      const Wrench on_proxy = exerted(by.coupling, by.limits, by.step, engine_.state(by.proxy), dt);
      if (by.proxy == proxy_) {
        mean = on_proxy;
      } else {
        peer_work_[user_index(by.proxy)].hold({-on_proxy.force, -on_proxy.torque});
      }
    }
    border_->end(engine_, dt);
    for (const JointLoad& load : engine_.joint_loads()) others_work_j_ += std::max(0.0, load.motor_j);
    if (has_driven_surfaces_) others_work_j_ += std::max(0.0, surface_work(scene_, engine_.contacts()));
    bodies_energy_.observe(engine_, members_);
    observe_contacts(indicators);
    return mean;
  }

  void change_rate(double before, double after) override {
    rate_ = after;
    for (const UserSpec& user : scene_.users) {
      if (!engine_.contains(user.proxy)) continue;
      const BodyState proxy = at_rate(engine_.state(user.proxy), before, after);
      engine_.set_velocity(user.proxy, proxy.linear_velocity, proxy.angular_velocity);
      declutch(user);
    }
  }

  void follow(const WorldFrame& frame, const HapticReport* mine, const Age& age) override {
    int substeps = 1;
    if (mine != nullptr) {
      const std::span<const PairShift> pairs = synchroniser_.synchronise(frame, *mine, age.cycles);
      if (scheme_.properties.corrects_gradually) {
        const double most = std::max(1.0, std::round(frame.cycle_s / scene_.settings.h_s));
        substeps = unfelt_parts(pairs, user_of(proxy_)->coupling, static_cast<int>(most));
      }
      for (const PairShift& pair : pairs) {
        if (!engine_.contains(pair.id)) continue;
        const bool member = std::ranges::binary_search(members_, pair.id);
        gradual_.begin(engine_, pair.id, engine_.state(pair.id), pair.sub, member ? substeps : 1);
      }
    }
    others_work_j_ += frame.outside_work_j - outside_work_j_;
    release_peers();
    follow_membership(frame, age.s);
    follow_border(frame, age, substeps);
  }

  bool reset_from(const WorldFrame& frame) override {
    release_peers();
    gradual_.clear();
    synchroniser_.forget();
    for (const StampedBody& s : frame.states) {
      if (engine_.contains(s.id)) engine_.set_state(s.id, s.state);
    }
    border_->clear(engine_);
    follow_membership(frame, 0.0);
    follow_border(frame, {}, 1);
    return engine_.contains(proxy_);
  }

  void describe(HapticReport& report) override {
    for (const BodyId id : members_) report.members.push_back({id, gradual_.completed(id, engine_.state(id))});
    if (compares_islands_) Authority::label(scene_, islands_, members_, engine_.contacts(), {}, report.islands);
    report.indicators.border_bodies = border_bodies_;
    report.peer_age_s = std::exchange(peer_age_s_, 0.0);
    border_->log(report.stamp, engine_);
  }

  BodyState proxy() const override {
    return engine_.contains(proxy_) ? engine_.state(proxy_) : scene_.initial[index(proxy_)];
  }
  std::size_t members() const noexcept override { return members_.size(); }
  std::size_t contacts() const noexcept override { return engine_.contacts().size(); }
  std::uint64_t peers() const noexcept override {
    std::uint64_t users = 0;
    for (const PeerDevice& peer : peers_) {
      if (is_followed(peer)) users |= std::uint64_t{1} << user_index(peer.proxy);
    }
    return users;
  }
  OthersEnergy others() const noexcept override { return bodies_energy_.beside(others_work_j_); }
  LiveEngine* engine() noexcept override { return &engine_; }
  bool reports_afterwards() const noexcept override { return true; }

 private:
  /// The coupling of a proxy in the present step.
  struct Pull {
    BodyId proxy;
    CouplingSettings coupling;
    ForceLimits limits;
    ImplicitStep step;
  };
  /// Returns the force with which the step begins, N.
  double pull(const Tool& tool, const ForceLimits& limits, const DevicePose& device, double dt) {
    const BodyId proxy = tool.body.id;
    const ImplicitStep step = implicit_step(tool.coupling, limits, tool.body, engine_.state(proxy), device, dt);
    hold(engine_, proxy, step);
    pulls_.push_back({proxy, tool.coupling, limits, step});
    return step.wrench.force.norm();
  }

  /// Returns how hard they press, N.
  double move_peers(std::span<const DeviceState* const> heard, double time_s, double dt) {
    double force_n = 0.0;
    outside_pulls_.clear();
    for (const PeerDevice& peer : peers_) {
      const std::size_t number = user_index(peer.proxy);
      if (number == scene_.users.size()) continue;
      const UserSpec& user = scene_.users[number];
      const bool spring = user.device.kind == DeviceKind::impedance;
      const auto [device, applied] = peer_motion(peer, number, number < heard.size() ? heard[number] : nullptr, time_s);
      if (!std::ranges::binary_search(members_, peer.proxy)) {
        if (!spring) continue;  // a part of the ghost's force
        const Tool tool = tool_at(rate_, user, scene_.body(peer.proxy));
        outside_pulls_.push_back({peer.proxy, device, tool.coupling, user.device.force_limit_n});
        continue;
      }
      const BodyState now = engine_.state(peer.proxy);
      const Pose port = spring ? device.pose : Pose{now.position, now.orientation};
      const PortWork::Work work = peer_work_[number].step(port, applied);
      others_work_j_ += work.linear_j + work.angular_j;
      // By the device's pose where there is a coupling: a force that is late drops what it holds.
      if (!spring) {
        engine_.apply_force(peer.proxy, applied.force, applied.torque);
        force_n += applied.force.norm();
        continue;
      }
      force_n += pull(tool_at(rate_, user, scene_.body(peer.proxy)), limits_of(user.device), device, dt);
    }
    return force_n;
  }

  struct PeerMotion {
    DevicePose device;
    Wrench applied;  ///< admittance devices
  };

  /// A peer's device in this step, by the newest of the world's account and its own state.
  [[nodiscard]] PeerMotion peer_motion(const PeerDevice& peer, std::size_t number, const DeviceState* heard,
                                       double time_s) {
    const UserSpec& user = scene_.users[number];
    PeerMotion motion{{peer.pose, peer.linear_velocity, peer.angular_velocity}, peer.applied};
    // In the peer's sub-world, the state of a device that is slower than the haptic step holds until the next one.
    const double period_s = 1.0 / user.device.rate_hz;
    const double held_s = period_s > kSlower * scene_.settings.h_s ? period_s : 0.0;
    double at_s = peers_stamp_s_;
    double held_on_s = 0.0;
    const PeerForecast* forecast = nullptr;
    if (heard != nullptr && is_followed(peer)) forecasts_[number].observe(*heard);
    // One from the future is of a device that was started again, of which the account does not know the offset yet.
    const bool of_another =
        heard != nullptr && at_s + rate_ * (heard->stamp_s - peer.device_s - kLongestGuess_s) > time_s;
    if (heard != nullptr && !of_another && heard->stamp_s + held_s > peer.device_s) {
      motion.device = {{heard->pose.position + peer.offset, heard->pose.orientation * peer.turn},
                       heard->linear_velocity / rate_,
                       heard->angular_velocity / rate_};
      motion.applied = heard->applied;
      at_s += rate_ * (heard->stamp_s - peer.device_s);
      held_on_s = rate_ * held_s;
      forecast = &forecasts_[number];
    }
    double age_s = time_s - at_s;
    if (held_on_s > 0.0) age_s = held_on_s * std::floor(age_s / held_on_s + kSameTime);
    const double ahead_s = std::min(age_s, rate_ * kLongestGuess_s);
    if (forecast == nullptr) {
      motion.device.pose.position += ahead_s * motion.device.linear_velocity;
    } else if (ahead_s != 0.0) {
      forecast->advance(motion.device, ahead_s, rate_);
    }
    motion.applied = saturated(motion.applied, limits_of(user.device));
    peer_age_s_ = std::max(peer_age_s_, age_s);
    return motion;
  }

  /// The proxy without what an implicit step of its coupling adds to it.
  void declutch(const UserSpec& user) {
    const Body body = tool_at(rate_, user, scene_.body(user.proxy)).body;
    engine_.set_inertia(body.id, body.mass, body.inertia);
  }

  void release_peers() {
    for (const PeerDevice& peer : peers_) {
      const UserSpec* user = user_of(peer.proxy);
      if (user != nullptr && std::ranges::binary_search(members_, peer.proxy)) declutch(*user);
    }
  }

  [[nodiscard]] std::size_t user_index(BodyId proxy) const {
    return static_cast<std::size_t>(std::ranges::find(scene_.users, proxy, &UserSpec::proxy) - scene_.users.begin());
  }
  /// Not a peer whose proxy the world holds, whose device then says nothing about it.
  [[nodiscard]] static bool is_followed(const PeerDevice& peer) noexcept { return peer.device_s != kHeldDevice_s; }
  [[nodiscard]] const UserSpec* user_of(BodyId proxy) const {
    const std::size_t user = user_index(proxy);
    return user == scene_.users.size() ? nullptr : &scene_.users[user];
  }

  void follow_membership(const WorldFrame& frame, double lag_s) {
    const auto remove = [&](std::vector<BodyId>& have, const std::vector<BodyId>& want) {
      missing_from(have, want, scratch_);
      for (const BodyId id : scratch_) {
        gradual_.forget(id);
        engine_.remove(id);
      }
      std::erase_if(have, [&](BodyId id) { return std::ranges::binary_search(scratch_, id); });
    };
    remove(members_, frame.members);
    remove(fixed_, frame.fixed);
    for (const BodyId id : frame.members) {
      const std::optional<BodyState> handed_over = border_->release(id, engine_);
      if (!handed_over) continue;
      engine_.add(scene_.body(id), *handed_over);
      members_.insert(std::ranges::lower_bound(members_, id), id);
    }
    for (const EnteringBody& entering : frame.entering) {
      const BodyId id = entering.body.id;
      std::vector<BodyId>& have = entering.body.fixed() ? fixed_ : members_;
      const std::vector<BodyId>& want = entering.body.fixed() ? frame.fixed : frame.members;
      if (engine_.contains(id) || !std::ranges::binary_search(want, id)) continue;
      Body body = entering.body;
      const Body& known = scene_.body(id);  // with what messages do not tell
      body.group = known.group;
      body.material = known.material;
      body.surface_velocity = known.surface_velocity;
      body.surface_turn = known.surface_turn;
      engine_.add(body, advanced(entering.state, lag_s));
      if (const UserSpec* user = user_of(id)) declutch(*user);
      have.insert(std::ranges::lower_bound(have, id), id);
    }
  }

  void follow_border(const WorldFrame& frame, const Age& age, int substeps) {
    bodies_energy_.break_joints(frame.broken_joints, engine_);
    const Correction part = scheme_.correction({.lag_cycles = age.cycles}, {}, scene_.settings);
    border_->follow(frame, engine_, {.lag_s = age.s, .gain = part.sub, .substeps = substeps});
    border_bodies_ = frame.border_bodies;
    compares_islands_ = !frame.islands.empty();
    peers_ = frame.peers;
    std::erase_if(peers_, [this](const PeerDevice& peer) { return peer.proxy == proxy_; });
    peers_stamp_s_ = frame.stamp_s;
    outside_work_j_ = frame.outside_work_j;
    bodies_energy_.follow(frame, members_);
    for (std::size_t u = 0; u < peer_work_.size(); ++u) {
      const BodyId proxy = scene_.users[u].proxy;
      const bool moved = std::ranges::find(peers_, proxy, &PeerDevice::proxy) != peers_.end();
      if (!moved || !std::ranges::binary_search(members_, proxy)) peer_work_[u].restart();
    }
  }

  void observe_contacts(Indicators& indicators) {
    std::uint32_t on_proxy = 0;
    for (const Contact& c : reads_friction_ ? engine_.contacts_with_friction() : engine_.contacts()) {
      const double magnitude = c.normal_impulse + c.tangential_impulse.norm();
      indicators.total_impulse_n_s += magnitude;
      if (c.a != proxy_ && c.b != proxy_) continue;
      indicators.proxy_impulse_n_s += magnitude;
      ++on_proxy;
    }
    indicators.proxy_contacts = std::max(indicators.proxy_contacts, on_proxy);
  }

  const Scheme& scheme_;
  const Scene& scene_;
  BodyId proxy_;
  LiveEngine engine_;
  GradualShifts gradual_;
  Synchroniser synchroniser_;
  BodiesEnergy bodies_energy_;
  bool has_driven_surfaces_;
  bool reads_friction_;  ///< of contacts
  std::unique_ptr<SubWorldSide> border_;
  std::vector<BodyId> members_, fixed_;  ///< ascending
  std::vector<PeerDevice> peers_;
  double peers_stamp_s_ = 0.0;
  double peer_age_s_ = 0.0;              ///< greatest since the last report
  std::vector<PortWork> peer_work_;      ///< by user
  std::vector<PeerForecast> forecasts_;  ///< by user
  std::vector<Pull> pulls_;
  std::vector<PeerPull> outside_pulls_;
  double others_work_j_ = 0.0;
  double outside_work_j_ = 0.0;  ///< part of it, of peers that are not members
  double rate_ = 1.0;            ///< of the clock
  bool begun_ = false;
  std::uint32_t border_bodies_ = 0;
  bool compares_islands_ = false;
  Islands islands_;
  std::vector<BodyId> scratch_;
};

}  // namespace

std::unique_ptr<LocalModel> make_neighbourhood(const Scheme& scheme, const Scene& scene, std::size_t user) {
  return std::make_unique<SimulatedNeighbourhood>(scheme, scene, user);
}

}  // namespace subworld
