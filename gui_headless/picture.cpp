#include "picture.hpp"

#include "figure.hpp"
#include "model/error.hpp"
#include "rays.hpp"

#include <fmt/core.h>
#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <string>
#include <thread>

namespace subworld {
namespace {

using V = Eigen::Vector3f;

constexpr int kPart = 2;              // a pixel has kPart x kPart samples
constexpr int kRows = 16;             // of pixels, that a thread draws at a time
constexpr int kShadowSamples = 1024;  // width of the shadow map
constexpr float kMemberVeil = 0.20F;  // share of a member's colour where the proxy is behind it
constexpr float kOtherVeil = 0.22F;   // share of another body's colour where a member or the proxy is behind it
constexpr double kLightReach = 1.6;   // of the light's view, in radii of the shown objects
constexpr double kGroundReach = 3.5;  // of the grid, in radii of the shown objects
constexpr float kShadow = 0.75F;      // darkness of a shadow on a body

/// Calls `keep(solid, column, row, depth)` where rays of these rows enter solids, up to a layer, in front of the eye.
void trace(const View& view, const std::vector<Solid>& solids, Solid::Layer last, int from_row, int to_row, auto keep) {
  for (std::uint32_t i = 0; i < solids.size(); ++i) {
    if (solids[i].layer > last) continue;
    const auto [left, end, top, bottom] = view.extent(solids[i].centre, solids[i].radius);
    if (left >= end || top >= to_row || bottom <= from_row) continue;
    const View own = view.seen_from(solids[i]);
    for (int row = std::max(top, from_row); row < std::min(bottom, to_row); ++row) {
      for (int column = left; column < end; ++column) {
        const float depth = enter(solids[i], own.ray(column, row));
        if (depth > 0.0F && depth < kNone) keep(i, column, row, depth);
      }
    }
  }
}

/// Does `work` for each of these numbers, on all cores.
void in_parallel(int numbers, auto work) {
  std::atomic<int> next = 0;
  const auto take = [&] {
    for (int number = next++; number < numbers; number = next++) work(number);
  };
  std::vector<std::jthread> others;
  for (unsigned i = 1; i < std::thread::hardware_concurrency(); ++i) others.emplace_back(take);
  take();
}

float smooth(float from, float to, float x) {
  const float part = std::clamp((x - from) / (to - from), 0.0F, 1.0F);
  return part * part * (3.0F - 2.0F * part);
}
V mix(const V& a, const V& b, float part) { return a + part * (b - a); }

V to_float(const Vec3& v) { return v.cast<float>(); }

/// The rays, the lights and the shadows of a figure.
class Scenery {
 public:
  Scenery(const Figure& figure, PictureSize size) : figure_(figure) {
    const CameraAxes axes = axes_of(figure.camera);
    const double step = 2.0 * std::tan(0.5 * figure.camera.vertical_fov_rad) / (kPart * size.height);
    view_ = {to_float(figure.camera.eye - figure.origin),
             to_float(step * axes.right),
             to_float(-step * axes.up),
             to_float(axes.forward),
             false,
             kPart * size.width,
             kPart * size.height};
    // The lights move with the camera, so that the visible sides are lit.
    const Vec3 key = (0.85 * Vec3::UnitZ() - 0.30 * axes.right - 0.38 * axes.forward).normalized();
    key_ = to_float(key);
    fill_ = to_float((0.35 * Vec3::UnitZ() + 0.80 * axes.right - 0.30 * axes.forward).normalized());
    const double radius = std::max(figure.movable.radius, 1e-6), reach = kLightReach * radius;
    const CameraAxes of_light = axes_of({2.0 * reach * key, Vec3::Zero(), 1.0});
    texel_ = static_cast<float>(2.0 * reach / kShadowSamples);
    light_ = {to_float(2.0 * reach * key),
              texel_ * to_float(of_light.right),
              -texel_ * to_float(of_light.up),
              to_float(of_light.forward),
              true,
              kShadowSamples,
              kShadowSamples};
    ground_reach_ = static_cast<float>(kGroundReach * radius);
    edge_ = static_cast<float>(std::max(1.0, size.height / 720.0)) * kPart;
    for (const Solid& solid : figure.solids)
      if (solid.layer == Solid::Layer::glass) glass_.emplace_back(&solid, view_.seen_from(solid));
    cast_shadows();
  }

  /// Colours of the rows of pixels from this one on.
  void paint(int first, Image& image) const {
    const int width = view_.width, from = kPart * first, to = std::min(from + kPart * kRows, view_.height);
    std::array<std::vector<Hit>, kLayers> hits;
    for (auto& layer : hits) layer.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(to - from));
    const auto place = [&](int column, int row) { return static_cast<std::size_t>((row - from) * width + column); };
    trace(view_, figure_.solids, Solid::Layer::outline, from, to,
          [&](std::uint32_t i, int column, int row, float depth) {
            Hit& hit = hits[static_cast<std::size_t>(figure_.solids[i].layer)][place(column, row)];
            if (depth < hit.depth) hit = {depth, i};
          });
    std::vector<V> sums(static_cast<std::size_t>(image.width * (to - from) / kPart), V::Zero());
    for (int row = from; row < to; ++row) {
      for (int column = 0; column < width; ++column) {
        std::array<Hit, kLayers> here;
        for (std::size_t layer = 0; layer < kLayers; ++layer) here[layer] = hits[layer][place(column, row)];
        sums[static_cast<std::size_t>((row - from) / kPart * image.width + column / kPart)] +=
            colour_of(here, column, row);
      }
    }
    std::uint8_t* out = image.rgb.data() + 3 * static_cast<std::size_t>(first * image.width);
    for (const V& sum : sums)
      for (int k = 0; k < 3; ++k)
        *out++ = static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(sum[k] / (kPart * kPart), 0.0F, 1.0F)));
  }

 private:
  static constexpr std::size_t kLayers = 5;  // but the glass
  struct Hit {
    float depth = kNone;
    std::uint32_t solid = 0;
  };

  void cast_shadows() {
    shadows_.assign(std::size_t{kShadowSamples} * kShadowSamples, kNone);
    in_parallel(kShadowSamples / kRows, [&](int part) {
      trace(light_, figure_.solids, Solid::Layer::other, part * kRows, (part + 1) * kRows,
            [&](std::uint32_t, int column, int row, float depth) {
              float& nearest = shadows_[static_cast<std::size_t>(row * kShadowSamples + column)];
              nearest = std::min(nearest, depth);
            });
    });
  }

  /// The share of the key light that reaches a point.
  [[nodiscard]] float lit(const V& point, const V& normal) const {
    const V way = point + 1.5F * texel_ * normal - light_.eye;  // from a little above the surface
    const float depth = light_.ahead.dot(way) - 2.0F * texel_;
    const auto at = [&](const V& axis) {
      return static_cast<int>(std::floor(axis.dot(way) / (texel_ * texel_) + 0.5F * kShadowSamples));
    };
    const int column = at(light_.right), row = at(light_.down);
    if (std::min(column, row) < 1 || std::max(column, row) >= kShadowSamples - 1) return 1.0F;
    int free = 0;
    for (int k = 0; k < 9; ++k)
      free += depth <= shadows_[static_cast<std::size_t>((row + k / 3 - 1) * kShadowSamples + column + k % 3 - 1)];
    return static_cast<float>(free) / 9.0F;
  }

  /// The darkness of an edge line at a distance from the edge, m; lines of small bodies are thin.
  [[nodiscard]] float line_at(float edge_m, float depth, float radius_m, float pixels) const {
    const float sample_m = depth * view_.right.norm(), size = 2.0F * radius_m / sample_m / edge_;
    return edge_m < pixels * edge_ * sample_m * std::clamp(size / 45.0F, 0.45F, 1.0F) ? smooth(3.0F, 18.0F, size)
                                                                                      : 0.0F;
  }

  /// `flatness`: 0: shaded, 1: the plain colour.
  [[nodiscard]] V shaded(const Hit& hit, int column, int row, float shadow, float flatness) const {
    const Solid& solid = figure_.solids[hit.solid];
    const Ray ray = view_.seen_from(solid).ray(column, row);
    const auto [own_normal, edge_m] = surface(solid, ray.from + hit.depth * ray.along);
    const Ray seen = view_.ray(column, row);
    const V view = -seen.along.normalized(), albedo = solid.colour.cwiseProduct(solid.colour);
    V n = solid.turn * own_normal;
    if (n.dot(view) < 0.0F) n = -n;
    const float light = shadow > 0.0F ? 1.0F - shadow * (1.0F - lit(seen.from + hit.depth * seen.along, n)) : 1.0F;
    const float key = std::max(n.dot(key_), 0.0F) * light, fill = std::max(n.dot(fill_), 0.0F);
    const V sky = mix(V(0.40F, 0.40F, 0.41F), V::Constant(0.58F), 0.5F * n.z() + 0.5F);
    V colour = albedo.cwiseProduct(sky + V::Constant(0.52F * key + 0.14F * fill));
    const float grazing = 1.0F - std::max(n.dot(view), 0.0F);
    colour += V::Constant(0.10F * light * std::pow(std::max(n.dot((key_ + view).normalized()), 0.0F), 40.0F));
    colour *= 1.0F - 0.35F * grazing * grazing * grazing;
    if (flatness == 0.0F) colour = mix(colour, 0.12F * albedo, 0.85F * line_at(edge_m, hit.depth, solid.radius, 1.2F));
    return mix(colour, albedo, flatness).cwiseMax(0.0F).cwiseSqrt();
  }

  [[nodiscard]] V with_grounds(V colour, float nearest, const Ray& ray) const {
    for (const Ground& ground : figure_.grounds) {
      const V up = ground.turn.col(2);
      const float falls = -up.dot(ray.along), depth = up.dot(ray.from - ground.origin) / falls;
      if (falls <= 0.0F || depth <= 0.0F || depth >= nearest) continue;  // from below, it would cover everything
      const V at = ray.from + depth * ray.along;
      const Eigen::Vector2f plane = (ground.turn.transpose() * (at - ground.origin)).head<2>();
      const float fade = 1.0F - smooth(0.25F, 1.0F, plane.norm() / ground_reach_);
      const auto grid = [&](double every, float pixels) {
        const double period = 10.0 * figure_.grid_m;
        const Eigen::Vector2d begin = ground.offset - period * (ground.offset / period).array().floor().matrix();
        const Eigen::Array2f u = (plane + begin.cast<float>()).array() / static_cast<float>(every);
        const float width = depth * view_.right.norm() * kPart * ray.along.norm() / falls / static_cast<float>(every);
        const float away = ((u - 0.5F) - (u - 0.5F).floor() - 0.5F).abs().minCoeff() / width;
        return (1.0F - smooth(pixels - 0.5F, pixels + 0.5F, away)) * (1.0F - smooth(0.08F, 0.3F, width));
      };
      const float line = std::max(0.45F * grid(figure_.grid_m, 0.6F), 0.8F * grid(10.0 * figure_.grid_m, 0.9F));
      const float shade = 0.42F * (1.0F - lit(at, V::Zero()));
      const float alpha = 1.0F - (1.0F - 0.55F * fade) * (1.0F - line * fade) * (1.0F - shade);
      const V floor = mix(V(0.90F, 0.91F, 0.92F), V(0.66F, 0.69F, 0.73F), line);
      colour = mix(colour, mix(floor, V(0.30F, 0.32F, 0.36F), shade), alpha);
    }
    return colour;
  }

  [[nodiscard]] V with_glass(V colour, float nearest, int column, int row) const {
    for (const auto& [solid, view] : glass_) {
      const Ray ray = view.ray(column, row);
      const auto [in, out] = crossings(solid->size, ray);
      for (const float depth : {out, in}) {
        if (depth <= 0.0F || depth >= nearest) continue;
        const auto [normal, edge_m] = surface(*solid, ray.from + depth * ray.along);
        const float line = line_at(edge_m, depth, solid->radius, 0.9F);
        const float face = 0.07F + 0.15F * smooth(0.5F, 0.9F, std::abs((solid->turn * normal).z()));
        colour = mix(colour, (1.0F - 0.45F * line) * solid->colour, face + (0.65F - face) * line);
      }
    }
    return colour;
  }

  [[nodiscard]] V colour_of(const std::array<Hit, kLayers>& hits, int column, int row) const {
    const auto& [proxy, member, other, line, outline] = hits;
    if (line.depth < kNone) return shaded(line, column, row, 0.0F, 0.55F);
    if (outline.depth < kNone) return V::Ones();
    const float height = 1.0F - (static_cast<float>(row) + 0.5F) / static_cast<float>(view_.height);
    V colour = mix(V::Ones(), V(0.93F, 0.95F, 0.97F), smooth(0.2F, 1.0F, height));
    float nearest = kNone;
    const auto add = [&](const Hit& hit, float shadow, float veil) {
      if (hit.depth >= nearest) return;
      colour = mix(colour, shaded(hit, column, row, shadow, 0.0F), nearest < kNone ? veil : 1.0F);
      nearest = hit.depth;
    };
    add(proxy, 0.0F, 1.0F);
    add(member, 0.0F, kMemberVeil);
    add(other, kShadow, kOtherVeil);
    return with_glass(with_grounds(colour, nearest, view_.ray(column, row)), nearest, column, row);
  }

  const Figure& figure_;
  View view_, light_;
  V key_, fill_;                              // unit, towards the lights
  float texel_ = 0.0F, ground_reach_ = 0.0F;  // m
  float edge_ = 1.0F;                         // samples for a pixel of an edge line
  std::vector<std::pair<const Solid*, View>> glass_;
  std::vector<float> shadows_;  // depths that the key light sees
};

/// The image of a figure: four rays a pixel, each crossed with the solids whose ball covers its place. One light casts
/// shadows, by a map of the depths that it sees.
Image render(const Figure& figure, PictureSize size) {
  const auto pixels = static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height);
  Image image{size.width, size.height, std::vector<std::uint8_t>(3 * pixels)};
  const Scenery scenery(figure, size);
  in_parallel((size.height + kRows - 1) / kRows, [&](int part) { scenery.paint(part * kRows, image); });
  return image;
}

/// Of a PNG: its length, type, content and checksum.
std::string text_chunk(const char* keyword, const std::string& text) {
  const auto number = [](auto value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
    return bytes;
  };
  const std::string content = fmt::format("{}{}{}", keyword, '\0', text), chunk = "tEXt" + content;
  const auto* const bytes = reinterpret_cast<const Bytef*>(chunk.data());
  return number(content.size()) + chunk + number(crc32(0, bytes, static_cast<uInt>(chunk.size())));
}

}  // namespace

Drawing draw(const Picture& picture, PictureSize size) {
  if (std::min(size.width, size.height) < 16 || std::max(size.width, size.height) > 8192) {
    throw Error(ExitCode::usage, fmt::format("picture of {} x {} pixels: width and height must lie within 16 .. 8192",
                                             size.width, size.height));
  }
  const Figure figure = compose(picture, size);
  return {render(figure, size), figure.camera, figure.line_m_per_n_s, figure.omitted};
}

void write_png(const std::string& file, const Image& image, const std::string& software) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  if (image.width <= 0 || image.height <= 0 || image.rgb.size() != PNG_IMAGE_SIZE(png)) {
    throw Error(ExitCode::failed, fmt::format("{}: picture of {} x {} pixels with {} bytes: expected 3 bytes a pixel",
                                              file, image.width, image.height, image.rgb.size()));
  }
  std::string bytes(PNG_IMAGE_PNG_SIZE_MAX(png), '\0');
  png_alloc_size_t size = bytes.size();
  if (png_image_write_to_memory(&png, bytes.data(), &size, 0, image.rgb.data(), 0, nullptr) == 0)
    throw Error(ExitCode::failed, fmt::format("{}: cannot write the picture: {}", file, png.message));
  bytes.resize(size);
  constexpr std::size_t kHeader_bytes = 33;  // signature and IHDR
  std::ofstream stream(file, std::ios::binary);
  stream << bytes.insert(kHeader_bytes, text_chunk("Software", software));
  if (!stream.flush())
    throw Error(ExitCode::failed, fmt::format("{}: cannot write the picture: {}", file, std::strerror(errno)));
}

}  // namespace subworld
