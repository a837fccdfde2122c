#include "harco/mount.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "marker/file.hpp"
#include "yaml_fields.hpp"

namespace harco {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

struct Direction {
  const char* name;
  Vector3d axis;  ///< body frame
};

const std::array<Direction, 6>& directions() {
  static const std::array<Direction, 6> all{{{"nose", Vector3d::UnitX()},
                                             {"tail", -Vector3d::UnitX()},
                                             {"right", Vector3d::UnitY()},
                                             {"left", -Vector3d::UnitY()},
                                             {"down", Vector3d::UnitZ()},
                                             {"up", -Vector3d::UnitZ()}}};
  return all;
}

std::optional<Vector3d> direction(const YAML::Node& root, const std::string& key) {
  const YAML::Node node = root[key];
  if (!node) return std::nullopt;
  const std::string word = node.IsScalar() ? node.Scalar() : "";
  for (const Direction& known : directions())
    if (word == known.name) return known.axis;
  throw Wrong(quoted(key) + " must be nose, tail, right, left, up or down");
}

template <int N>
std::optional<Eigen::Matrix<double, N, 1>> numbers(const YAML::Node& root, const std::string& key) {
  const YAML::Node node = root[key];
  if (!node) return std::nullopt;
  if (!node.IsSequence() || node.size() != N)
    throw Wrong(quoted(key) + " is not a list of " + std::to_string(N) + " numbers");
  Eigen::Matrix<double, N, 1> values;
  for (int i = 0; i < N; ++i)
    values[i] = number(node[i], quoted(key) + ": element " + std::to_string(i));
  return values;
}

/// The rotation of a camera that looks along `z` with its image's top towards `top`.
Matrix3d facing(const Vector3d& z, const Vector3d& top) {
  if (std::abs(z.dot(top)) > 0.5)
    throw Wrong("'image_top' must be square to 'looks': a camera can't have its image's top there");
  Matrix3d body_R_camera;
  body_R_camera << top.cross(z) * -1.0, -top, z;
  return body_R_camera;
}

Matrix3d turned(const Vector3d& roll_pitch_yaw_deg) {
  const Vector3d angles = roll_pitch_yaw_deg * (std::acos(-1.0) / 180.0);
  return (Eigen::AngleAxisd(angles.z(), Vector3d::UnitZ()) *
          Eigen::AngleAxisd(angles.y(), Vector3d::UnitY()) *
          Eigen::AngleAxisd(angles.x(), Vector3d::UnitX()))
      .toRotationMatrix();
}

Matrix3d from_quaternion(const Eigen::Vector4d& wxyz) {
  if (std::abs(wxyz.norm() - 1.0) > 1e-3)
    throw Wrong("'quaternion_wxyz' is no rotation: its length is not 1");
  return Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).normalized().toRotationMatrix();
}

Matrix3d rotation(const YAML::Node& root) {
  const auto looks = direction(root, "looks");
  const auto top = direction(root, "image_top");
  const auto angles = numbers<3>(root, "roll_pitch_yaw_deg");
  const auto quaternion = numbers<4>(root, "quaternion_wxyz");
  if (quaternion) {
    if (looks || top || angles)
      throw Wrong("'quaternion_wxyz' says it all: nothing else may give the rotation beside it");
    return from_quaternion(*quaternion);
  }
  if (!looks && !angles) throw Wrong("it doesn't say where the camera looks: 'looks' is missing");
  const Vector3d z = looks.value_or(Vector3d::UnitX());
  const Vector3d usual_top = z.z() == 0.0 ? Vector3d(-Vector3d::UnitZ()) : Vector3d::UnitX();
  return turned(angles.value_or(Vector3d::Zero())) * facing(z, top.value_or(usual_top));
}

Mount read_mount(const YAML::Node& root) {
  if (!root.IsMap()) throw Wrong("not a mount's description");
  constexpr std::array kKnown{"looks", "image_top", "roll_pitch_yaw_deg", "quaternion_wxyz",
                              "offset_m"};
  for (const auto& entry : root) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "?";
    if (std::find(kKnown.begin(), kKnown.end(), key) == kKnown.end())
      throw Wrong(
          quoted(key) +
          " is not known (looks, image_top, roll_pitch_yaw_deg, quaternion_wxyz, offset_m)");
  }
  Mount mount;
  mount.body_T_camera = Eigen::Isometry3d::Identity();
  mount.body_T_camera.linear() = rotation(root);
  mount.body_T_camera.translation() = numbers<3>(root, "offset_m").value_or(Vector3d::Zero());
  return mount;
}

}  // namespace

Eigen::Isometry3d Mount::looking_down() {
  Eigen::Isometry3d body_T_camera = Eigen::Isometry3d::Identity();
  body_T_camera.linear() = facing(Vector3d::UnitZ(), Vector3d::UnitX());
  return body_T_camera;
}

Mount parse_mount(const std::string& yaml, const std::string& name) {
  return parse_yaml(yaml, name, read_mount);
}

Mount load_mount(const std::filesystem::path& file) {
  return parse_mount(read_text_file(file), file.string());
}

std::string format_mount(const Mount& mount) {
  const Matrix3d rotation = mount.body_T_camera.linear();
  const Vector3d offset = mount.body_T_camera.translation();
  if (!mount.body_T_camera.matrix().allFinite() || !rotation.isUnitary(1e-6) ||
      rotation.determinant() < 0.0)
    throw std::invalid_argument("format_mount: body_T_camera is no rigid motion");
  const Eigen::Quaterniond q(rotation);
  const auto list = [](std::initializer_list<double> values) {
    std::string text;
    for (const double value : values) text += (text.empty() ? "[" : ", ") + to_text(value);
    return text + "]\n";
  };
  return "# body frame: x to the nose, y to the right, z down; camera: x right, y down, z forward\n"
         "quaternion_wxyz: " +
         list({q.w(), q.x(), q.y(), q.z()}) +
         "offset_m: " + list({offset.x(), offset.y(), offset.z()});
}

void save_mount(const Mount& mount, const std::filesystem::path& file) {
  write_text_file(file, format_mount(mount));
}

}  // namespace harco
