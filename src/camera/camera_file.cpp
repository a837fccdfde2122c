// Camera files: OpenCV's FileStorage YAML and ROS's camera_info YAML differ in little but their
// first line and the names of the lens models.
#include <algorithm>
#include <charconv>
#include <cmath>

#include <yaml-cpp/yaml.h>

#include "harco/camera.hpp"
#include "harco/error.hpp"
#include "marker/file.hpp"
#include "yaml_fields.hpp"

namespace harco {
namespace {

int size(const YAML::Node& root, const std::string& key) {
  const std::string what = quoted(key);
  const int value = whole(field(root, key, what), what);
  if (value <= 0) throw Wrong(what + " must be positive");
  return value;
}

struct Matrix {
  int rows = 0;
  int cols = 0;
  std::vector<double> data;
};

Matrix matrix(const YAML::Node& node, const std::string& key) {
  const std::string what = quoted(key);
  if (!node.IsMap()) throw Wrong(what + " is not a matrix (rows, cols, data)");
  const auto part = [&](const char* name) { return field(node, name, what + ": " + quoted(name)); };
  Matrix matrix;
  matrix.rows = whole(part("rows"), what + ": 'rows'");
  matrix.cols = whole(part("cols"), what + ": 'cols'");
  const YAML::Node data = part("data");
  if (!data.IsSequence()) throw Wrong(what + ": 'data' is not a list");
  for (const YAML::Node& value : data)
    matrix.data.push_back(number(value, what + ": element " + std::to_string(matrix.data.size())));
  if (matrix.rows < 0 || matrix.cols < 0 ||
      static_cast<double>(matrix.data.size()) != double{1} * matrix.rows * matrix.cols)
    throw Wrong(what + ": 'data' has " + std::to_string(matrix.data.size()) + " values, not " +
                std::to_string(matrix.rows) + " x " + std::to_string(matrix.cols));
  return matrix;
}

void read_intrinsics(const YAML::Node& root, Camera& camera) {
  const std::string key = "camera_matrix";
  const Matrix k = matrix(field(root, key, quoted(key)), key);
  if (k.rows != 3 || k.cols != 3) throw Wrong("'camera_matrix' is not 3 x 3");
  if (k.data[1] != 0.0) throw Wrong("'camera_matrix': skew is not supported");
  if (k.data[3] != 0.0 || k.data[6] != 0.0 || k.data[7] != 0.0 || k.data[8] != 1.0)
    throw Wrong("'camera_matrix' is not of the form fx 0 cx, 0 fy cy, 0 0 1");
  camera.fx = k.data[0];
  camera.cx = k.data[2];
  camera.fy = k.data[4];
  camera.cy = k.data[5];
}

LensModel read_lens(const YAML::Node& root) {
  for (const char* key : {"fisheye_model", "fisheye"})
    if (const YAML::Node flag = root[key]; flag && whole(flag, quoted(key)) != 0)
      return LensModel::equidistant;
  const YAML::Node model = root["distortion_model"];
  if (!model) return LensModel::brown_conrady;
  const std::string name = model.IsScalar() ? model.Scalar() : "";
  if (name == "equidistant" || name == "fisheye") return LensModel::equidistant;
  if (name == "plumb_bob" || name == "rational_polynomial") return LensModel::brown_conrady;
  throw Wrong("'distortion_model' \"" + name +
              "\" is not known (plumb_bob, rational_polynomial, equidistant, fisheye)");
}

void read_distortion(const YAML::Node& root, Camera& camera) {
  const std::string key = "distortion_coefficients";
  camera.lens = read_lens(root);
  if (!root[key] || root[key].IsNull()) return;
  const std::vector<double> values = matrix(root[key], key).data;
  const std::string has = quoted(key) + " has " + std::to_string(values.size()) + " values, ";
  const auto is_one_of = [&](std::initializer_list<std::size_t> sizes) {
    return std::find(sizes.begin(), sizes.end(), values.size()) != sizes.end();
  };
  if (camera.lens == LensModel::equidistant && !is_one_of({0, 4}))
    throw Wrong(has + "not the 4 of the equidistant lens");
  if (!is_one_of({0, 4, 5, 8, 12, 14})) throw Wrong(has + "not 4, 5 or 8");
  const std::size_t known = std::min(values.size(), camera.coefficients.size());
  if (std::any_of(values.begin() + static_cast<std::ptrdiff_t>(known), values.end(),
                  [](double k) { return k != 0.0; }))
    throw Wrong(has +
                "and those beyond the 8th (thin prism, tilt), which are not supported, "
                "are not all zero");
  std::copy_n(values.begin(), known, camera.coefficients.begin());
}

Camera read_camera(const YAML::Node& root) {
  if (!root.IsMap()) throw Wrong("not a camera description");
  Camera camera;
  camera.width = size(root, "image_width");
  camera.height = size(root, "image_height");
  read_intrinsics(root, camera);
  read_distortion(root, camera);
  validate(camera);
  return camera;
}

std::string matrix_text(const char* key, int rows, int cols, const std::vector<double>& data) {
  std::string text = std::string(key) + ": !!opencv-matrix\n   rows: " + std::to_string(rows) +
                     "\n   cols: " + std::to_string(cols) + "\n   dt: d\n   data: [ ";
  for (std::size_t i = 0; i < data.size(); ++i) text += (i == 0 ? "" : ", ") + to_text(data[i]);
  return text + " ]\n";
}

}  // namespace

Camera parse_camera(const std::string& yaml, const std::string& name) {
  return parse_yaml(yaml, name, read_camera);
}

Camera load_camera(const std::filesystem::path& file) {
  return parse_camera(read_text_file(file), file.string());
}

std::string format_camera(const Camera& camera) {
  validate(camera);
  const bool equidistant = camera.lens == LensModel::equidistant;
  const bool rational = std::any_of(camera.coefficients.begin() + 5, camera.coefficients.end(),
                                    [](double k) { return k != 0.0; });
  const int count = equidistant ? 4 : rational ? 8 : 5;
  std::string text = "%YAML:1.0\n---\n";
  text += "image_width: " + std::to_string(camera.width) + "\n";
  text += "image_height: " + std::to_string(camera.height) + "\n";
  text += matrix_text("camera_matrix", 3, 3,
                      {camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0});
  text += std::string("distortion_model: ") +
          (equidistant ? "equidistant"
           : rational  ? "rational_polynomial"
                       : "plumb_bob") +
          "\n";
  text += matrix_text("distortion_coefficients", 1, count,
                      {camera.coefficients.begin(), camera.coefficients.begin() + count});
  return text;
}

void save_camera(const Camera& camera, const std::filesystem::path& file) {
  write_text_file(file, format_camera(camera));
}

}  // namespace harco
