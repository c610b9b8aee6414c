// Where a NIfTI volume is: by a matrix (sform), by a quaternion (qform), or by the distances of voxels alone.
//
// Written is what comes back to the last bit, as far as floats of 32 bits can say it: both forms where the
// matrix says it exactly and the volume is rigid; the quaternion alone where only it does; else the matrix,
// rounded. A volume in no known world that has spacing and no more is written without either.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "formats/volume/facts.h"
#include "formats/volume/nifti_header.h"

namespace voxkit::nifti {
namespace {

/// The qform as the header has it.
struct Quaternion {
  std::array<double, 3> bcd{};
  std::array<double, 3> steps{1, 1, 1};
  std::array<double, 3> offset{};
  bool mirrored = false;  ///< pixdim[0] below 0: the third axis runs the other way

  Affine affine() const {
    auto [b, c, d] = bcd;
    const double square = b * b + c * c + d * d;
    double a = 1 - square;
    if (a < 1e-7) {  // by the specification: a turn by 180 degrees
      const double scale = 1 / std::sqrt(square);
      b *= scale, c *= scale, d *= scale;
      a = 0;
    } else {
      a = std::sqrt(a);
    }
    const double rotation[3][3] = {{a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)},
                                   {2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)},
                                   {2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - c * c - b * b}};
    Affine affine;
    for (size_t k = 0; k < 3; ++k)
      for (size_t i = 0; i < 3; ++i)
        affine.axes[k][i] = rotation[i][k] * (k == 2 && mirrored ? -steps[k] : steps[k]) + 0.0;
    affine.origin = offset;
    return affine;
  }
};

/// The quaternion that is the nearest to the axes, in floats of 32 bits; its matrix need not be equal.
Quaternion quaternion_of(const Affine& affine) {
  Quaternion q;
  const Affine::Vector lengths = affine.spacing();
  q.mirrored = affine.determinant() < 0;
  double r[3][3];
  for (size_t k = 0; k < 3; ++k)
    for (size_t i = 0; i < 3; ++i)
      r[i][k] = affine.axes[k][i] / (k == 2 && q.mirrored ? -lengths[k] : lengths[k]);
  // From the greatest of the four, so that nothing is lost in a difference.
  const double squares[4] = {1 + r[0][0] + r[1][1] + r[2][2], 1 + r[0][0] - r[1][1] - r[2][2],
                             1 - r[0][0] + r[1][1] - r[2][2], 1 - r[0][0] - r[1][1] + r[2][2]};
  const auto greatest = static_cast<size_t>(std::max_element(squares, squares + 4) - squares);
  const double root = std::sqrt(squares[greatest]) / 2, part = 0.25 / root;
  double w[4];
  const double sums[3] = {r[0][1] + r[1][0], r[0][2] + r[2][0], r[1][2] + r[2][1]};
  const double differences[3] = {r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]};
  w[greatest] = root;
  if (greatest == 0) {
    for (size_t i = 0; i < 3; ++i) w[i + 1] = differences[i] * part;
  } else {
    w[0] = differences[greatest - 1] * part;
    for (size_t i = 1; i < 4; ++i)
      if (i != greatest) w[i] = sums[i + greatest - 3] * part;
  }
  const double sign = w[0] < 0 ? -1 : 1;
  for (size_t i = 0; i < 3; ++i) {
    // What rounding leaves of zero is zero.
    q.bcd[i] = std::abs(w[i + 1]) < 1e-15 ? 0 : static_cast<float>(sign * w[i + 1]);
    q.steps[i] = static_cast<float>(lengths[i]);
    q.offset[i] = static_cast<float>(affine.origin[i]);
  }
  return q;
}

/// The same where its matrix is equal to the last bit: rounding may have left its neighbour.
std::optional<Quaternion> exact_quaternion(const Affine& affine) {
  const Quaternion nearest = quaternion_of(affine);
  if (nearest.affine() == affine) return nearest;
  constexpr int most = 2;
  std::array<std::array<double, 2 * most + 1>, 3> near{};
  for (size_t i = 0; i < 3; ++i) {
    auto up = static_cast<float>(nearest.bcd[i]), down = up;
    near[i][0] = up;
    for (size_t k = 1; k <= most; ++k) {
      near[i][2 * k - 1] = up = std::nextafter(up, 2.0f);
      near[i][2 * k] = down = std::nextafter(down, -2.0f);
    }
  }
  Quaternion q = nearest;
  for (const double b : near[0])
    for (const double c : near[1])
      for (const double d : near[2]) {
        q.bcd = {b, c, d};
        if (q.affine() == affine) return q;
      }
  return std::nullopt;
}

double length(const Affine::Vector& v) {
  return std::hypot(v[0], v[1], v[2]);
}

bool is_finite(const Affine& affine) {
  const auto finite = [](const Affine::Vector& v) {
    return std::all_of(v.begin(), v.end(), [](double x) { return std::isfinite(x); });
  };
  return finite(affine.origin) && std::all_of(affine.axes.begin(), affine.axes.end(), finite);
}

/// Whether places differ by more than the rounding of a quaternion's floats explains.
bool differ(const Affine& affine, const Affine& other, const Quaternion& q, Index3 dims) {
  double square = 0, diagonal = 0, far = length(affine.origin), worst = 0;
  for (const double x : q.bcd) square += x * x;
  const Affine::Vector steps = affine.spacing();
  for (size_t k = 0; k < 3; ++k) {
    diagonal += steps[k] * static_cast<double>(dims[static_cast<int>(k)]);
    far += diagonal;
  }
  for (int corner = 0; corner < 8; ++corner) {
    Affine::Vector index{};
    for (int k = 0; k < 3; ++k)
      index[static_cast<size_t>(k)] = (corner >> k & 1) != 0 ? static_cast<double>(dims[k] - 1) : 0;
    const Affine::Vector a = affine.place(index), b = other.place(index);
    worst = std::max(worst, length({a[0] - b[0], a[1] - b[1], a[2] - b[2]}));
  }
  // The fourth number of a quaternion is what the others leave, so it is the less exact the smaller it is.
  const double fourth = std::sqrt(std::max(1 - square, 1e-7));
  const double least = *std::min_element(steps.begin(), steps.end());
  return worst > 1e-3 * least + 2e-6 * far + 3e-7 / fourth * diagonal;
}

Quaternion quaternion_of(const Header& header) {
  Quaternion q;
  q.bcd = header.quaternion;
  q.offset = header.offset_q;
  q.mirrored = header.pixdim[0] < 0;
  for (size_t k = 0; k < 3; ++k) {
    const double step = std::abs(header.pixdim[k + 1]);
    q.steps[k] = step > 0 && std::isfinite(step) ? step : 1;
  }
  return q;
}

std::string code_name(int code) {
  constexpr const char* names[] = {"none", "scanner", "aligned", "Talairach", "MNI 152", "template"};
  return fmt::format("{} ({})", code, code >= 0 && code < 6 ? names[code] : "another one");
}

Affine rounded(const Affine& affine) {
  Affine floats = affine;
  for (Affine::Vector& axis : floats.axes)
    for (double& x : axis) x = static_cast<float>(x);
  for (double& x : floats.origin) x = static_cast<float>(x);
  return floats;
}

/// The unit to write lengths in, and its code; the affine follows.
int write_unit(Unit unit, Affine& affine) {
  const auto in = [&](Unit to, int code) {
    if (unit != to) affine = in_unit(affine, unit, to);
    return code;
  };
  switch (unit) {
    case Unit::unknown:
      return NIFTI_UNITS_UNKNOWN;
    case Unit::metre:
      return NIFTI_UNITS_METER;
    case Unit::millimetre:
    case Unit::centimetre:
    case Unit::inch:
      return in(Unit::millimetre, NIFTI_UNITS_MM);
    default:
      return in(Unit::micrometre, NIFTI_UNITS_MICRON);
  }
}

}  // namespace

void read_placement(const Header& header, VolumeInfo& info, Context& ctx) {
  constexpr Unit units[] = {Unit::unknown, Unit::metre, Unit::millimetre, Unit::micrometre};
  const int unit = header.units & 7;
  info.unit = unit < 4 ? units[unit] : Unit::unknown;
  if (unit >= 4) ctx.note(fmt::format("{}: the unit of code {} is not known: dropped", header.name, unit));
  const Quaternion q = quaternion_of(header);
  Affine sform;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t k = 0; k < 3; ++k) sform.axes[k][i] = header.rows[i][k];
    sform.origin[i] = header.rows[i][3];
  }
  const bool finite = is_finite(sform);
  for (size_t k = 0; k < 3; ++k)  // of one slice the matrix may leave out the third axis
    if (info.dims[static_cast<int>(k)] > 1 && sform.axes[k] == Affine::Vector{}) sform.axes[k][0] = NAN;
  complete_axes(sform, q.steps);
  const Affine qform = q.affine();
  const bool has_sform = header.sform_code > 0, has_qform = header.qform_code > 0;
  const auto take = [&](const Affine& affine, int code) {
    info.affine = affine;
    info.world = World::ras;
    info.space_code = code <= 255 ? static_cast<uint8_t>(code) : uint8_t{0};
  };
  const auto bad = [&](const char* form, bool is_finite) {
    ctx.note(fmt::format("{}: the {} has {}: dropped", header.name, form,
                         is_finite ? "axes that are zero or in one plane" : "numbers that are not finite"));
  };
  if (has_sform && sform.is_valid()) {
    take(sform, header.sform_code);
    if (has_qform && (!qform.is_valid() || differ(sform, qform, q, info.dims))) {
      ctx.note(fmt::format("{}: the qform puts the volume elsewhere: the sform is taken", header.name));
    } else if (has_qform && header.qform_code != header.sform_code) {
      ctx.note(fmt::format("{}: the qform is of code {}: dropped for that of the sform, {}", header.name,
                           code_name(header.qform_code), code_name(header.sform_code)));
    }
    return;
  }
  if (has_sform) bad("sform", finite);
  std::vector<std::string> assumed;
  for (size_t k = 0; k < 3; ++k) {
    const double step = header.pixdim[k + 1];
    const bool said = step != 0 && std::isfinite(step);
    if (!said && info.dims[static_cast<int>(k)] > 1) assumed.push_back(fmt::format("{}", k + 1));
  }
  if (!assumed.empty())
    ctx.note(fmt::format("{}: the distance of voxels along ax{} {} is not said: 1 is assumed", header.name,
                         assumed.size() == 1 ? "is" : "es", listed(assumed)));
  if (has_qform && qform.is_valid()) return take(qform, header.qform_code);
  if (has_qform) bad("qform", is_finite(qform));
  info.affine = Affine::plain(q.steps, {0, 0, 0});
  if (header.kind != Kind::analyze) return;
  info.unit = parse_unit(header.analyze_unit).value_or(Unit::unknown);
  ctx.note(fmt::format("{}: an Analyze header has no orientation: the directions of its axes are not known",
                       header.name));
}

void write_placement(const std::string& name, const VolumeInfo& info, nifti_1_header& header, Context& ctx) {
  Affine affine = info.affine;
  if (is_anatomical(info.world)) affine = in_world(affine, info.world, World::ras);
  header.xyzt_units = static_cast<char>(write_unit(info.unit, affine));
  const Affine::Vector steps = affine.spacing();
  for (size_t k = 0; k < 3; ++k) header.pixdim[k + 1] = static_cast<float>(steps[k]);
  header.pixdim[0] = 1;
  int code = info.space_code > 0 ? info.space_code : NIFTI_XFORM_SCANNER_ANAT;
  if (!is_anatomical(info.world)) {
    if (info.world == World::unknown && affine == Affine::plain(steps, {0, 0, 0})) return;
    code = NIFTI_XFORM_ALIGNED_ANAT;
    ctx.note(fmt::format(
        "{}: the world of the volume is {}: NIfTI has that of a patient only, RAS, and places are written so",
        name, info.world == World::unknown ? "not known" : std::string(voxkit::name(info.world))));
  }
  const Affine matrix = rounded(affine);
  const bool matrix_exact = matrix == affine;
  const auto exact = exact_quaternion(affine);
  const Quaternion q = exact ? *exact : quaternion_of(affine);
  if (exact || !differ(affine, q.affine(), q, info.dims)) {
    header.qform_code = static_cast<short>(code);
    header.pixdim[0] = q.mirrored ? -1 : 1;
    for (size_t k = 0; k < 3; ++k) header.pixdim[k + 1] = static_cast<float>(q.steps[k]);
    header.quatern_b = static_cast<float>(q.bcd[0]);
    header.quatern_c = static_cast<float>(q.bcd[1]);
    header.quatern_d = static_cast<float>(q.bcd[2]);
    header.qoffset_x = static_cast<float>(q.offset[0]);
    header.qoffset_y = static_cast<float>(q.offset[1]);
    header.qoffset_z = static_cast<float>(q.offset[2]);
  }
  if (exact && !matrix_exact) return;
  header.sform_code = static_cast<short>(code);
  float* const rows[3] = {header.srow_x, header.srow_y, header.srow_z};
  for (size_t i = 0; i < 3; ++i) {
    for (size_t k = 0; k < 3; ++k) rows[i][k] = static_cast<float>(matrix.axes[k][i]);
    rows[i][3] = static_cast<float>(matrix.origin[i]);
  }
}

}  // namespace voxkit::nifti
