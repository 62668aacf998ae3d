#include "rays.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

using V = Eigen::Vector3f;

std::array<int, 4> View::extent(const V& centre, float radius) const {
  const V way = centre - eye;
  const float depth = ahead.dot(way), scale = parallel ? 1.0F : depth;
  if (depth <= -radius) return {0, 0, 0, 0};
  if (!parallel && depth <= 1.001F * radius) return {0, width, 0, height};
  const auto range = [&](const V& axis, int size) {
    const float step = axis.norm(), tangent = axis.dot(way) / step / scale;
    const float half = parallel ? radius : radius * std::hypot(1.0F, tangent) / (depth - radius);
    const float middle = tangent / step + 0.5F * static_cast<float>(size), most = static_cast<float>(size);
    return std::pair{static_cast<int>(std::clamp(std::floor(middle - half / step), 0.0F, most)),
                     static_cast<int>(std::clamp(std::ceil(middle + half / step), 0.0F, most))};
  };
  const auto [left, end] = range(right, width);
  const auto [top, bottom] = range(down, height);
  return {left, end, top, bottom};
}

std::pair<float, float> crossings(const V& half, const Ray& ray) {
  const Eigen::Array3f inverse = ray.along.array().inverse();
  const Eigen::Array3f a = (-half - ray.from).array() * inverse, b = (half - ray.from).array() * inverse;
  const float in = a.min(b).maxCoeff(), out = a.max(b).minCoeff();
  return in <= out ? std::pair{in, out} : std::pair{kNone, kNone};
}

namespace {

float enter_capsule(float radius, float half, Ray ray) {
  const auto enter = [&](float a, float b, float c) {
    const float root = b * b - a * c;
    return root < 0.0F || a <= 0.0F ? kNone : (-b - std::sqrt(root)) / a;
  };
  const V &o = ray.from, &d = ray.along;
  const auto flat = [](const V& p, const V& q) { return p.x() * q.x() + p.y() * q.y(); };
  const float across = flat(d, d), side = enter(across, flat(o, d), flat(o, o) - radius * radius);
  const bool steep = across < 1e-10F * d.z() * d.z();
  if (side == kNone && !steep) return kNone;
  const float z = steep ? -std::copysign(kNone, d.z()) : o.z() + side * d.z();
  if (std::abs(z) <= half) return side;
  const V end = o - V(0.0F, 0.0F, std::copysign(half, z));  // what is entered first is the ball at this end
  return enter(d.squaredNorm(), end.dot(d), end.squaredNorm() - radius * radius);
}

float enter_frustum(const V& size, const Ray& ray) {
  const V &o = ray.from, &d = ray.along;
  const float half = size.z(), slope = (size.y() - size.x()) / (2.0F * half), mean = 0.5F * (size.x() + size.y());
  float first = kNone;
  const auto take = [&](float t, float beyond) {
    if (t > 0.0F && t < first && beyond <= 0.0F) first = t;
  };
  const float r = mean + slope * o.z(), s = slope * d.z();  // the radius along the ray is r + s t
  const float a = d.x() * d.x() + d.y() * d.y() - s * s, b = o.x() * d.x() + o.y() * d.y() - r * s;
  const float root = b * b - a * (o.x() * o.x() + o.y() * o.y() - r * r);
  if (root >= 0.0F && a != 0.0F) {
    for (const float sign : {-1.0F, 1.0F}) {
      const float t = (-b + sign * std::sqrt(root)) / a;
      take(t, std::abs(o.z() + t * d.z()) - half);
    }
  }
  for (const auto& [z, radius] : {std::pair{-half, size.x()}, {half, size.y()}}) {
    const float t = (z - o.z()) / d.z();
    take(t, std::hypot(o.x() + t * d.x(), o.y() + t * d.y()) - radius);
  }
  return first;
}

/// Moeller and Trumbore.
float enter_triangle(const Eigen::Matrix3f& triangle, const Ray& ray) {
  const V p = ray.along.cross(triangle.col(2));
  const float scale = triangle.col(1).dot(p);
  if (scale == 0.0F) return kNone;
  const V from = ray.from - triangle.col(0), q = from.cross(triangle.col(1));
  const float u = from.dot(p) / scale, v = ray.along.dot(q) / scale;
  return u < 0.0F || v < 0.0F || u + v > 1.0F ? kNone : triangle.col(2).dot(q) / scale;
}

}  // namespace

float enter(const Solid& s, const Ray& ray) {
  switch (s.form) {
    case Solid::Form::box:
      return crossings(s.size, ray).first;
    case Solid::Form::capsule:
      return enter_capsule(s.size.x(), s.size.y(), ray);
    case Solid::Form::frustum:
      return enter_frustum(s.size, ray);
    case Solid::Form::triangle:
      break;
  }
  return enter_triangle(s.triangle, ray);
}

std::pair<V, float> surface(const Solid& s, const V& at) {
  if (s.form == Solid::Form::triangle) return {s.triangle.col(1).cross(s.triangle.col(2)).normalized(), kNone};
  if (s.form == Solid::Form::capsule) {
    const float z = std::clamp(at.z(), -s.size.y(), s.size.y());
    return {(at - V(0.0F, 0.0F, z)).normalized(), kNone};
  }
  if (s.form == Solid::Form::box) {
    Eigen::Array3f inside = s.size.array() - at.array().abs();
    Eigen::Index face = 0;
    inside.minCoeff(&face);
    inside[face] = kNone;
    return {std::copysign(1.0F, at[face]) * V::Unit(face), inside.minCoeff()};
  }
  const float half = s.size.z(), slope = (s.size.y() - s.size.x()) / (2.0F * half);
  const float outward = std::hypot(at.x(), at.y()), radius = 0.5F * (s.size.x() + s.size.y()) + slope * at.z();
  const float to_end = half - std::abs(at.z());
  if (to_end < radius - outward) return {std::copysign(1.0F, at.z()) * V::UnitZ(), radius - outward};
  return {V(at.x(), at.y(), -slope * outward).normalized(), to_end};
}

}  // namespace subworld
