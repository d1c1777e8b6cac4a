// Adjusts the networks that the benchmark wrote with Ceres Solver; built and run by `scripts/bench geometry`.
//
// Residuals are those of `geom::bundle`: measured line and sample minus those of the line that sees the point,
// ranges, and the initial values. Orientations are the same cubics through samples, with the same unknowns and
// initial values. Derivatives are Ceres' automatic ones; those of the line follow from a last step of Newton's method
// in dual numbers.
#include <ceres/ceres.h>
#include <ceres/normal_prior.h>
#include <ceres/rotation.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

using Vector = Eigen::Vector3d;
using Matrix = Eigen::Matrix3d;
template <typename T>
using Of = Eigen::Matrix<T, 3, 1>;

// Both stop where the sum of squares changes by less than this share of itself.
constexpr double kChange = 1e-8;
constexpr double kLastStepLines = 1e-3;

struct Curve {
  Vector value, slope;
};

// Cubics between samples, with the slopes of the parabola through three neighbours.
struct Orientation {
  std::vector<double> x;
  std::vector<Curve> position, vector;
  Matrix reference;

  // Sets the slopes of the samples that were read.
  void finish(std::vector<Curve>& nodes) const {
    for (size_t row = 0; row < x.size(); ++row) {
      const size_t first = std::min(row == 0 ? 0 : row - 1, x.size() - 3);
      const auto chord = [&](size_t from) -> Vector {
        return (nodes[from + 1].value - nodes[from].value) / (x[from + 1] - x[from]);
      };
      const Vector before = chord(first);
      const Vector bend = (chord(first + 1) - before) / (x[first + 2] - x[first]);
      nodes[row].slope = before + bend * ((x[row] - x[first]) + (x[row] - x[first + 1]));
    }
  }

  // Position and rotation vector at a line.
  void at(double line, Curve& of_position, Curve& of_vector) const {
    const size_t after = std::lower_bound(x.begin(), x.end(), line) - x.begin();
    of_position = between(position, after, line);
    of_vector = between(vector, after, line);
  }

  Curve between(const std::vector<Curve>& nodes, size_t after, double line) const {
    if (after == 0 || after == x.size()) {
      const size_t end = std::min(after, x.size() - 1);
      return {nodes[end].value + nodes[end].slope * (line - x[end]), nodes[end].slope};
    }
    const Curve &before = nodes[after - 1], &next = nodes[after];
    const double width = x[after] - x[after - 1], s = (line - x[after - 1]) / width;
    const Vector rise = next.value - before.value;
    const Vector from = before.slope * width, to = next.slope * width;
    const Vector square = rise * 3.0 - from * 2.0 - to, cube = from + to - rise * 2.0;
    return {before.value + ((cube * s + square) * s + from) * s,
            ((cube * (3.0 * s) + square * 2.0) * s + from) / width};
  }
};

struct Image {
  double half_lines, focal_length;
  std::array<double, 18> sigmas;
  Orientation base;
};

Matrix cross(const Vector& v) {
  Matrix m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Matrix rotation(const Vector& vector) {
  Matrix m;
  ceres::AngleAxisToRotationMatrix(vector.data(), m.data());
  return m;
}

// The left Jacobian of the rotation vector times a change of it.
Vector turned(const Vector& vector, const Vector& change) {
  const double angle = vector.norm();
  const Matrix k = cross(vector);
  const double square = angle * angle;
  const double first = angle < 1e-3 ? 0.5 - square / 24 : (1 - std::cos(angle)) / square;
  const double second = angle < 1e-3 ? 1.0 / 6 - square / 120 : (angle - std::sin(angle)) / (square * angle);
  return change + k * change * first + k * (k * change) * second;
}

// Values of the corrections at t: positions, then rotations.
template <typename T>
void corrections(const T* unknowns, double t, Of<T>& shift, Of<T>& turn) {
  for (int axis = 0; axis < 3; ++axis) {
    const T* p = unknowns + 3 * axis;
    const T* r = p + 9;
    shift[axis] = p[0] + (p[1] + p[2] * t) * t;
    turn[axis] = r[0] + (r[1] + r[2] * t) * t;
  }
}

struct View {
  const Image* image;
  double line, y, px_per_line, sigma_along, sigma_across;

  // The last line but one of Newton's iteration, the initial pose there, and the change of the camera vector per line.
  bool see(const double* unknowns, const double* point, double& x, Vector& center, Matrix& base, Vector& rate) const {
    for (int step = 0; step < 20; ++step) {
      const double t = x / image->half_lines;
      Curve position, vector;
      image->base.at(x, position, vector);
      Vector shift, turn, slope, turning;
      corrections(unknowns, t, shift, turn);
      for (int axis = 0; axis < 3; ++axis) {
        const double* p = unknowns + 3 * axis;
        slope[axis] = (p[1] + 2 * p[2] * t) / image->half_lines;
        turning[axis] = (p[10] + 2 * p[11] * t) / image->half_lines;
      }
      center = position.value;
      base = rotation(vector.value) * image->base.reference;
      const Matrix correction = rotation(turn);
      const Matrix m = correction * base;
      const Vector q = m * (Vector(point) - center - shift);
      const Vector spin = turned(turn, turning) + correction * turned(vector.value, vector.slope);
      rate = spin.cross(q) - m * (position.slope + slope);
      const double by = -q.x() / rate.x();
      if (!std::isfinite(by)) return false;
      if (std::abs(by) < kLastStepLines) return true;
      x += by;
    }
    return false;
  }

  static double plain(double value) { return value; }
  template <typename T, int N>
  static double plain(const ceres::Jet<T, N>& value) {
    return value.a;
  }

  template <typename T>
  bool operator()(const T* unknowns, const T* point, T* residuals) const {
    double known[18], place[3];
    for (int i = 0; i < 18; ++i) known[i] = plain(unknowns[i]);
    for (int i = 0; i < 3; ++i) place[i] = plain(point[i]);
    double x = line;
    Vector center, rate;
    Matrix base;
    if (!see(known, place, x, center, base, rate)) return false;
    Of<T> shift, turn, q;
    corrections(unknowns, x / image->half_lines, shift, turn);
    Of<T> away;
    for (int axis = 0; axis < 3; ++axis) away[axis] = point[axis] - center[axis] - shift[axis];
    const Of<T> seen = base.cast<T>() * away;
    ceres::AngleAxisRotatePoint(turn.data(), seen.data(), q.data());
    const T by = -q[0] / rate.x();
    residuals[0] = (by + (x - line)) * (px_per_line / sigma_along);
    const T across = q[1] + by * rate.y(), depth = q[2] + by * rate.z();
    residuals[1] = (y + image->focal_length * across / depth) / sigma_across;
    return true;
  }
};

struct Range {
  double t, range, sigma;
  Vector position;

  template <typename T>
  bool operator()(const T* unknowns, const T* point, T* residual) const {
    Of<T> shift, turn;
    corrections(unknowns, t, shift, turn);
    Of<T> away;
    for (int axis = 0; axis < 3; ++axis) away[axis] = point[axis] - position[axis] - shift[axis];
    residual[0] = (range - away.norm()) / sigma;
    return true;
  }
};

// The numbers of a network in sequence, as the benchmark writes them.
struct Numbers {
  std::vector<double> all;
  size_t next = 0;

  explicit Numbers(const std::string& path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    if (!file) throw std::runtime_error("cannot read " + path);
    all.resize(static_cast<size_t>(file.tellg()) / sizeof(double));
    file.seekg(0);
    file.read(reinterpret_cast<char*>(all.data()), static_cast<std::streamsize>(all.size() * sizeof(double)));
  }
  double one() { return all.at(next++); }
  size_t count() { return static_cast<size_t>(one()); }
  Vector three() {
    const double a = one(), b = one(), c = one();
    return {a, b, c};
  }
};

int main(int arguments, char** values) {
  if (arguments != 3) return 2;
  const std::string name = values[1];
  Numbers numbers(values[2]);
  std::vector<Image> images(numbers.count());
  for (Image& image : images) {
    image.half_lines = numbers.one();
    image.focal_length = numbers.one();
    for (double& sigma : image.sigmas) sigma = numbers.one();
    for (int row = 0; row < 3; ++row) image.base.reference.row(row) = numbers.three().transpose();
    for (size_t left = numbers.count(); left > 0; --left) {
      image.base.x.push_back(numbers.one());
      image.base.position.push_back({numbers.three(), Vector::Zero()});
      image.base.vector.push_back({numbers.three(), Vector::Zero()});
    }
    image.base.finish(image.base.position);
    image.base.finish(image.base.vector);
  }
  std::vector<std::array<double, 18>> unknowns(images.size(), std::array<double, 18>{});
  std::vector<Vector> points, deviations;
  for (size_t left = numbers.count(); left > 0; --left) {
    points.push_back(numbers.three());
    deviations.push_back(numbers.three());
  }

  const auto began = std::chrono::steady_clock::now();
  ceres::Problem problem;
  for (size_t left = numbers.count(); left > 0; --left) {
    const size_t point = numbers.count(), image = numbers.count();
    View view{&images[image]};
    view.line = numbers.one();
    view.y = numbers.one();
    view.sigma_along = numbers.one();
    view.sigma_across = numbers.one();
    view.px_per_line = numbers.one();
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<View, 2, 18, 3>(new View(view)), nullptr,
                             unknowns[image].data(), points[point].data());
  }
  for (size_t left = numbers.count(); left > 0; --left) {
    const size_t point = numbers.count(), image = numbers.count();
    Range range;
    range.t = numbers.one() / images[image].half_lines;
    range.range = numbers.one();
    range.sigma = numbers.one();
    range.position = numbers.three();
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Range, 1, 18, 3>(new Range(range)), nullptr,
                             unknowns[image].data(), points[point].data());
  }
  for (size_t image = 0; image < images.size(); ++image) {
    Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(18, 18);
    for (int i = 0; i < 18; ++i) weights(i, i) = 1 / images[image].sigmas[i];
    problem.AddResidualBlock(new ceres::NormalPrior(weights, Eigen::VectorXd::Zero(18)), nullptr,
                             unknowns[image].data());
  }
  ceres::ParameterBlockOrdering* ordering = new ceres::ParameterBlockOrdering;
  for (size_t point = 0; point < points.size(); ++point) {
    if (deviations[point].x() > 0) {
      const Eigen::MatrixXd weights = deviations[point].cwiseInverse().asDiagonal();
      problem.AddResidualBlock(new ceres::NormalPrior(weights, points[point]), nullptr, points[point].data());
    }
    ordering->AddElementToGroup(points[point].data(), 0);
  }
  for (auto& image : unknowns) ordering->AddElementToGroup(image.data(), 1);

  ceres::Solver::Options options;
  options.linear_solver_ordering.reset(ordering);
  // The reduced equations are dense for few images, and sparse for very many.
  options.linear_solver_type = images.size() > 100 ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
  options.num_threads = static_cast<int>(std::thread::hardware_concurrency());
  options.function_tolerance = kChange;
  options.gradient_tolerance = 0;
  options.parameter_tolerance = 1e-16;
  options.max_num_iterations = 100;
  // A priori values are part of the equations: without damping at the start, half the steps suffice.
  options.initial_trust_region_radius = 1e16;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();

  const double our_seconds = numbers.one(), our_squares = numbers.one();
  const double squares = 2 * summary.final_cost;
  std::printf(
      "adjustment, %s by Ceres (C++, automatic derivatives, %s, %d threads): %.4f s (%d steps, %.4f s of it derivatives and "
      "residuals), %.2f times ours of %.4f s, which include covariances; its sum of squares is 1 %+.1e of ours\n",
      name.c_str(), ceres::LinearSolverTypeToString(options.linear_solver_type), options.num_threads, seconds,
      summary.num_successful_steps, summary.jacobian_evaluation_time_in_seconds + summary.residual_evaluation_time_in_seconds,
      seconds / our_seconds, our_seconds, squares / our_squares - 1);
  if (!summary.IsSolutionUsable() || !(std::abs(squares / our_squares - 1) < 1e-6)) {
    std::printf("ceres: the two adjustments do not agree\n%s\n", summary.message.c_str());
    return 1;
  }
  return 0;
}
