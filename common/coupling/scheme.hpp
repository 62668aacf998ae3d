#pragma once

#include "coupling/border.hpp"
#include "coupling/virtual_coupling.hpp"
#include "model/exchange.hpp"
#include "model/scene.hpp"

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

namespace subworld {

/// How the user acts on the world's copy of the proxy during one step of the world's engine.
struct ProxyDrive {
  Wrench wrench;                     ///< constant
  std::optional<DevicePose> target;  ///< if set: a spring of the coupling's stiffness to it, implicit, on top
  ForceLimits limits;                ///< of that spring
};

/// What the user exerted on the proxy, mean over what lies between two reports; zero where nothing does.
[[nodiscard]] Wrench mean_wrench(const HapticReport& before, const HapticReport& now) noexcept;

/// The two copies of one body when they are made one.
struct CopyPair {
  bool proxy = false;       ///< the user's own
  bool peer = false;        ///< another user's proxy
  bool closed = false;      ///< its island lies wholly inside this sub-world, and in no other
  double lag_cycles = 0.0;  ///< age of the world's state when the sub-world uses it
};

/// Which part of the difference each copy is moved, 0 .. 1.
struct Correction {
  double world = 0.0;
  double sub = 0.0;
};

/// What a scheme's sub-world has at its border.
enum class Border : std::uint8_t {
  none,    ///< there is no sub-world: the proxy lives in the world alone; nothing is selected, extracted or corrected
  frozen,  ///< the world's impulses, divided over the haptic steps (paper 4.2)
  ghosts,  ///< outside bodies by their reduced models (coupling/ghost); islands decide who is right
};

/// A coupling scheme: pure functions over model data. The processes ask, they do not know which one runs.
class Scheme {
 public:
  virtual ~Scheme() = default;

  [[nodiscard]] virtual std::string_view name() const noexcept = 0;

  [[nodiscard]] virtual Border border() const noexcept = 0;
  /// Whether a sub-world moves the proxies of other users by their devices; else they are bodies as any.
  [[nodiscard]] virtual bool replicates_peers() const noexcept = 0;
  /// How many cycles the sub-world runs ahead: 0, both simulate the same cycle at the same time; 1, the world simulates
  /// a cycle when it knows what the user did in it.
  [[nodiscard]] virtual int lead_cycles() const noexcept = 0;
  /// Longest step of the world's engine, s, where the scene does not say how many sub-steps it makes.
  [[nodiscard]] virtual double longest_world_step_s() const noexcept = 0;

  /// What the user does to the world's proxy in the step that ends at `until_s`. `now` is the report of the cycle's end
  /// or the newest there is, `before` the one before it.
  [[nodiscard]] virtual ProxyDrive drive(const UserSpec& user, const HapticReport& before, const HapticReport& now,
                                         double until_s) const = 0;

  /// Whether the sub-world's part of a correction is spread over the cycle, or made at once.
  [[nodiscard]] virtual bool corrects_gradually() const noexcept = 0;
  [[nodiscard]] virtual Correction correction(const CopyPair& pair, const Indicators& indicators) const noexcept = 0;
};

/// Throws `Error` (usage) for an unknown name, naming those that exist.
[[nodiscard]] std::unique_ptr<Scheme> make_scheme(const Settings& settings);

}  // namespace subworld
