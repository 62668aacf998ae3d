#pragma once

#include "model/scene/scene.hpp"
#include "model/scene/scene_layout.hpp"
#include "model/scene/yaml_reader.hpp"

#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <unordered_map>

/// The readers of `load_scene`, one for each section of the file.
namespace subworld {

/// Limit on the number of bodies, checked before memory is allocated.
inline constexpr int kMostBodies = 100'000;

using Materials = std::map<std::string, Material, std::less<>>;

/// A material with an error is there with its defaults.
[[nodiscard]] Materials read_materials(const YamlValue& value, Faults& faults);

/// Reads a map by the table of settings (model/settings). `group`: the beginning of its keys there, as in "delay.";
/// empty: of the map `settings`; "users.": of a user.
void read_settings(const YamlValue& value, const std::string& group, Settings& settings, UserSpec& user);
/// The keys that such a map may have.
[[nodiscard]] std::vector<std::string_view> keys_in(std::string_view group);

/// A shape with the data from which its mass follows.
struct SolidShape {
  Shape shape;
  Pose frame;                          ///< frame of the body in the frame that the scene positions (meshes only)
  double volume = 0.0;                 ///< m^3; 0 for a plane or an open mesh
  double mass = 0.0;                   ///< kg, of parts that have masses of their own
  Vec3 inertia_per_kg = Vec3::Zero();  ///< m^2
  Vec3 half_extents = Vec3::Zero();    ///< m, of the bounds in the body frame
  double bounding_radius = 0.0;        ///< m, about the body's origin
};

inline constexpr Limits kLength{.least = 1e-6, .most = 1e6};   ///< m
inline constexpr Limits kPlace{.least = -1e6, .most = 1e6};    ///< m
inline constexpr Limits kMass{.least = 1e-9, .most = 1e12};    ///< kg
inline constexpr Limits kDensity{.least = 1e-6, .most = 1e9};  ///< kg/m^3

/// The key `rotation`; none where it is missing.
[[nodiscard]] Quat read_rotation(const YamlMap& map);

/// A hull that encloses something. Moves the mesh to its principal frame. Throws at `place`.
[[nodiscard]] SolidShape convex_solid(const YamlValue& place, Mesh& mesh);

/// Throws if the map has a measure of another shape.
void forbid_other_measures(const YamlMap& map, std::string_view shape);

/// Reads bodies, groups and proxies into the scene, numbered in the order of the file.
class BodyReader {
 public:
  BodyReader(Scene& scene, Materials materials) : scene_(scene), materials_(std::move(materials)) {}

  void read_bodies(const YamlValue& list);
  /// The proxy of a user: an existing body, or one of its own named "user/proxy". A body that is missing because of an
  /// error is replaced, so that this error alone is listed.
  [[nodiscard]] BodyId read_proxy(const YamlValue& value, const std::string& user);

 private:
  struct Template {
    Body body;
    BodyState state;  ///< state of the positioned frame
    Pose frame;       ///< frame of the body in the positioned frame
  };

  void read_body(const YamlValue& value);
  void read_solid(const YamlMap& map);
  void read_bin(const YamlMap& map);
  [[nodiscard]] Template read_template(const YamlMap& map, const SolidShape& solid) const;
  void read_mass(const YamlMap& map, const SolidShape& solid, Body& body) const;
  [[nodiscard]] Material read_material(const YamlMap& map) const;
  [[nodiscard]] SolidShape read_shape(const YamlMap& map, bool fixed);
  [[nodiscard]] SolidShape read_mesh_shape(const YamlMap& map, ShapeKind kind);
  /// The solids of a part; there are several of a tube.
  struct PartShape {
    SolidShape solid;
    std::vector<Pose> places;
  };
  [[nodiscard]] PartShape read_part_shape(const YamlMap& part);
  [[nodiscard]] SolidShape read_compound(const YamlMap& map, bool fixed);
  [[nodiscard]] Layout read_repeat(const YamlMap& body, const SolidShape& solid) const;
  void require_room(const YamlValue& value, std::int64_t count) const;
  BodyId add(const YamlValue& place, const std::string& name, const Template& made, const Pose& offset);

  Scene& scene_;
  Materials materials_;
  bool complete_ = false;  ///< all bodies were read
  std::unordered_map<std::string, BodyId> names_;
  std::map<std::tuple<std::string, double, bool, ShapeKind>, SolidShape> meshes_;  ///< each file is read once
};

/// Reads the users and, through `bodies`, their proxies.
void read_users(const YamlValue& list, BodyReader& bodies, Scene& scene);

}  // namespace subworld
