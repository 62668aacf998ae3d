#include "lab/random/shrink.hpp"

#include "lab/session/draw.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

/// Tries one change after another, and keeps those with which the scene still fails.
class Shrinker {
 public:
  Shrinker(Scene scene, const std::function<bool(const Scene&)>& fails, int most)
      : scene_(std::move(scene)), fails_(fails), left_(most) {}

  bool take(Scene smaller) {
    if (left_ <= 0) return false;
    --left_;
    if (!fails_(smaller)) return false;
    scene_ = std::move(smaller);
    return true;
  }
  /// `change` returns false if there is nothing to change.
  template <class Change>
  bool attempt(const Change& change) {
    Scene smaller = scene_;
    return change(smaller) && take(std::move(smaller));
  }
  template <class T>
  bool set(T Settings::*what, const T& plain) {
    return attempt([&](Scene& s) {
      if (s.settings.*what == plain) return false;
      s.settings.*what = plain;
      return true;
    });
  }

  bool users();
  bool bodies();
  bool settings();
  bool devices();
  bool numbers();
  bool duration();
  [[nodiscard]] bool tired() const noexcept { return left_ <= 0; }
  [[nodiscard]] Scene& scene() noexcept { return scene_; }

 private:
  bool device(std::size_t user);
  bool body(std::size_t body);

  Scene scene_;
  const std::function<bool(const Scene&)>& fails_;
  int left_;
};

bool Shrinker::users() {
  bool any = false;
  for (std::size_t u = scene_.users.size(); u-- > 0;) {
    if (scene_.users.size() > 1) any |= take(without_user(scene_, u));
  }
  return any;
}

bool Shrinker::bodies() {
  bool any = false;
  for (std::size_t part = std::max<std::size_t>(1, scene_.bodies.size() / 2); part > 0; part /= 2) {
    for (std::size_t from = 0; from < scene_.bodies.size() && !tired();) {
      std::vector<bool> out(scene_.bodies.size());
      for (std::size_t i = from; i < std::min(from + part, out.size()); ++i) out[i] = true;
      Scene smaller = without_bodies(scene_, out);
      if (smaller.bodies.size() < scene_.bodies.size() && take(std::move(smaller))) {
        any = true;
      } else {
        from += part;
      }
    }
  }
  return any;
}

bool Shrinker::settings() {
  bool any = false;
  const Settings plain;
  any |= set(&Settings::scheme, std::string("direct"));
  any |= attempt([](Scene& s) { return s.settings.delay.any() && (s.settings.delay = {}, true); });
  for (double DelaySettings::*delay :
       {&DelaySettings::jitter_s, &DelaySettings::loss_ratio, &DelaySettings::up_s, &DelaySettings::down_s,
        &DelaySettings::from_device_s, &DelaySettings::to_device_s}) {
    any |= attempt([&](Scene& s) { return s.settings.delay.*delay != 0.0 && (s.settings.delay.*delay = 0.0, true); });
  }
  any |= set(&Settings::ratio_most, 0);
  for (const int ratio : {1, 4, 10}) {
    if (scene_.settings.ratio > ratio) any |= set(&Settings::ratio, ratio);
  }
  any |= set(&Settings::settle_s, 0.0);
  any |= set(&Settings::settle_step_s, plain.settle_step_s);
  any |= set(&Settings::h_s, plain.h_s);
  any |= set(&Settings::passivity, plain.passivity);
  any |= attempt([](Scene& s) { return s.settings.world.substeps && (s.settings.world.substeps.reset(), true); });
  any |= attempt([&](Scene& s) {
    return s.settings.world.gravity != plain.world.gravity && !s.settings.world.gravity.isZero(0.0) &&
           (s.settings.world.gravity = s.settings.haptic.gravity = plain.world.gravity, true);
  });
  return any;
}

bool Shrinker::device(std::size_t u) {
  bool any = false;
  for (std::size_t i = scene_.users[u].device.path.size(); i-- > 0;) {
    any |= attempt([&](Scene& s) {
      std::vector<PathSegment>& path = s.users[u].device.path;
      path.erase(path.begin() + static_cast<std::ptrdiff_t>(i));
      return true;
    });
  }
  any |= attempt([&](Scene& s) {
    DeviceSpec plain;
    plain.path = s.users[u].device.path;
    if (std::ranges::any_of(plain.path, [](const PathSegment& p) { return p.kind == PathSegment::Kind::turn; }))
      plain.degrees_of_freedom = 6;
    DeviceSpec& d = s.users[u].device;
    const bool differs = d.kind != plain.kind || d.operator_model || d.degrees_of_freedom != plain.degrees_of_freedom ||
                         d.force_limit_n != plain.force_limit_n || d.rate_hz != plain.rate_hz;
    d = plain;
    return differs;
  });
  // The stiffness of an operator at an admittance device fits the tool.
  any |= attempt([&](Scene& s) {
    DeviceSpec& d = s.users[u].device;
    return d.kind == DeviceKind::impedance && d.operator_model && (d.operator_model.reset(), true);
  });
  any |= attempt([&](Scene& s) {
    const CouplingSettings plain;
    CouplingSettings& k = s.users[u].coupling;
    return (k.stiffness_n_m != plain.stiffness_n_m || k.damping_n_s_m != plain.damping_n_s_m) && (k = plain, true);
  });
  any |= attempt([&](Scene& s) {
    UserSpec& user = s.users[u];
    const UserSpec plain;
    if (user.selection == plain.selection && user.box_half_m == plain.box_half_m && !user.joins_late) return false;
    user.selection = plain.selection;
    user.box_half_m = plain.box_half_m;
    user.contact_depth = plain.contact_depth;
    user.budget_ratio = plain.budget_ratio;
    user.joins_late = false;
    return true;
  });
  return any;
}

bool Shrinker::devices() {
  bool any = false;
  for (std::size_t u = 0; u < scene_.users.size(); ++u) any |= device(u);
  return any;
}

bool Shrinker::body(std::size_t i) {
  bool any = false;
  any |= attempt([&](Scene& s) {
    BodyState& at = s.initial[i];
    if (at.linear_velocity.isZero(0.0) && at.angular_velocity.isZero(0.0)) return false;
    at.linear_velocity = at.angular_velocity = Vec3::Zero();
    return true;
  });
  any |= attempt([&](Scene& s) {
    const Material plain;
    Material& m = s.bodies[i].material;
    return (m.friction != plain.friction || m.restitution != plain.restitution) && (m = plain, true);
  });
  any |= attempt([&](Scene& s) {
    Body& body = s.bodies[i];
    const bool tool = std::ranges::find(s.users, body.id, &UserSpec::proxy) != s.users.end();
    if (body.fixed() || tool || body.mass == 1.0) return false;
    body.inertia /= body.mass;
    body.mass = 1.0;
    return true;
  });
  any |= attempt([&](Scene& s) {
    Quat& turn = s.initial[i].orientation;
    return turn.vec().norm() > 0.0 && (turn = Quat::Identity(), true);
  });
  for (const int digits : {2, 4}) {
    const bool rounder = attempt([&](Scene& s) {
      BodyState& at = s.initial[i];
      const BodyState before = at;
      at.position = rounded(at.position, digits);
      at.linear_velocity = rounded(at.linear_velocity, digits);
      at.angular_velocity = rounded(at.angular_velocity, digits);
      return at.position != before.position || at.linear_velocity != before.linear_velocity ||
             at.angular_velocity != before.angular_velocity;
    });
    any |= rounder;
    if (rounder) break;
  }
  return any;
}

bool Shrinker::numbers() {
  bool any = false;
  for (std::size_t i = 0; i < scene_.bodies.size() && !tired(); ++i) any |= body(i);
  return any;
}

bool Shrinker::duration() {
  bool any = false;
  for (const double part : {0.25, 0.5, 0.75})
    any |= attempt([&](Scene& s) {
      const double shorter_s = rounded(part * s.settings.duration_s, 2);
      return shorter_s >= 0.01 && shorter_s < s.settings.duration_s && (s.settings.duration_s = shorter_s, true);
    });
  return any;
}

}  // namespace

Scene without_bodies(const Scene& scene, const std::vector<bool>& out) {
  Scene less = scene;
  less.bodies.clear();
  less.initial.clear();
  std::vector<BodyId> ids(scene.bodies.size());
  for (const Body& body : scene.bodies) {
    const bool tool = std::ranges::find(scene.users, body.id, &UserSpec::proxy) != scene.users.end();
    if (out[index(body.id)] && !tool) continue;
    ids[index(body.id)] = static_cast<BodyId>(less.bodies.size());
    less.bodies.push_back(body);
    less.bodies.back().id = ids[index(body.id)];
    less.initial.push_back(scene.initial[index(body.id)]);
  }
  for (UserSpec& user : less.users) user.proxy = ids[index(user.proxy)];
  return less;
}

Scene without_user(const Scene& scene, std::size_t user) {
  Scene less = scene;
  less.users.erase(less.users.begin() + static_cast<std::ptrdiff_t>(user));
  less.settings.users = static_cast<int>(less.users.size());
  if (!scene.users[user].own_proxy) return less;
  std::vector<bool> out(scene.bodies.size());
  out[index(scene.users[user].proxy)] = true;
  return without_bodies(less, out);
}

Scene shrunk(Scene scene, const std::function<bool(const Scene&)>& fails, int most_tries) {
  Shrinker shrinker(std::move(scene), fails, most_tries);
  for (bool smaller = true; smaller && !shrinker.tired();) {
    smaller = false;
    smaller |= shrinker.duration();
    smaller |= shrinker.users();
    smaller |= shrinker.bodies();
    smaller |= shrinker.settings();
    smaller |= shrinker.devices();
    smaller |= shrinker.numbers();
  }
  return std::move(shrinker.scene());
}

}  // namespace subworld
