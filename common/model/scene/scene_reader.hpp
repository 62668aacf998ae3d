#pragma once

#include "model/scene/scene.hpp"
#include "model/scene/scene_layout.hpp"
#include "model/scene/yaml_reader.hpp"
#include "model/shapes/compound.hpp"

#include <map>
#include <optional>
#include <set>
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
/// Numbers the materials.
[[nodiscard]] std::vector<MaterialPair> read_pairs(const YamlValue& list, Materials& materials);

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

/// The key `material`; the defaults where it is missing.
[[nodiscard]] Material read_material(const YamlMap& map, const Materials& materials);

/// A hull that encloses something. Moves the mesh to its principal frame. Throws at `place`.
[[nodiscard]] SolidShape convex_solid(const YamlValue& place, Mesh& mesh);

/// What the body gives in place of what follows from its shape.
void read_inertia(const YamlMap& map, MassProperties& whole);

inline constexpr int kMostParts = 256;  ///< of a body

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
  /// The body of that name.
  [[nodiscard]] BodyId find_body(const YamlValue& name) const;
  /// The copies of a body with `repeat`, in their order.
  [[nodiscard]] std::vector<BodyId> find_copies(const YamlValue& name) const;

 private:
  struct Template {
    Body body;
    BodyState state;  ///< state of the positioned frame
    Pose frame;       ///< frame of the body in the positioned frame
  };

  void read_body(const YamlValue& value);
  void read_solid(const YamlMap& map);
  void read_bin(const YamlMap& map);
  [[nodiscard]] Template read_template(const YamlMap& map, const SolidShape& solid);
  void read_mass(const YamlMap& map, const SolidShape& solid, Body& body) const;
  [[nodiscard]] SolidShape read_shape(const YamlMap& map, bool fixed);
  struct MeshWords {
    std::string file;
    double scale = 1.0;
    bool y_up = false;
    auto operator<=>(const MeshWords&) const = default;
  };
  [[nodiscard]] static MeshWords read_mesh_words(const YamlMap& map);
  [[nodiscard]] Mesh read_mesh_file(const YamlMap& map, const MeshWords& words) const;
  [[nodiscard]] SolidShape read_mesh_shape(const YamlMap& map, ShapeKind kind);
  /// A closed mesh, as convex parts with its own mass properties.
  [[nodiscard]] SolidShape read_movable_mesh(const YamlMap& map);
  struct SolidParts {
    std::vector<std::pair<Shape, Pose>> parts;
    MassProperties whole;  ///< of the mesh, for a density of 1 kg/m^3
  };
  [[nodiscard]] SolidParts divide(const YamlMap& map, const MeshWords& words, double concavity_m, int most_parts);
  /// The solids of a part; there are several of a tube.
  struct PartShape {
    SolidShape solid;
    std::vector<Pose> places;
  };
  [[nodiscard]] PartShape read_part_shape(const YamlMap& part);
  [[nodiscard]] SolidShape read_compound(const YamlMap& map, bool fixed);
  [[nodiscard]] SolidShape add_compound(Compound whole, double volume);
  [[nodiscard]] Layout read_repeat(const YamlMap& body, const SolidShape& solid) const;
  void require_room(const YamlValue& value, std::int64_t count) const;
  BodyId add(const YamlValue& place, const std::string& name, const Template& made, const Pose& offset);

  Scene& scene_;
  Materials materials_;
  bool complete_ = false;  ///< all bodies were read
  std::unordered_map<std::string, BodyId> names_;
  std::map<std::string, std::uint32_t> groups_;
  std::map<std::pair<MeshWords, ShapeKind>, SolidShape> meshes_;      ///< each file is read once
  std::map<std::tuple<MeshWords, double, int>, SolidParts> divided_;  ///< with concavity and most parts
};

/// Reads the joints, after all bodies.
class JointReader {
 public:
  JointReader(Scene& scene, const BodyReader& bodies) : scene_(scene), bodies_(bodies) {}

  void read(const YamlValue& list);

 private:
  void read_joint(const YamlValue& value);
  /// A joint whose `in_a` has its orientation in the world.
  void add(const YamlMap& map, Joint joint, const Vec3& at);

  Scene& scene_;
  const BodyReader& bodies_;
  std::set<std::string> names_;
};

/// Reads the users and, through `bodies`, their proxies.
void read_users(const YamlValue& list, BodyReader& bodies, Scene& scene);

}  // namespace subworld
