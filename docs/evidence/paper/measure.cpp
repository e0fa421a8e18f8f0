// What the figures' scripts measure in pictures, and how they put pictures side by side. Results are JSON on
// standard output.
//   measure ssim A B                       mean squared difference (0 to 255) and SSIM of two PNGs
//   measure modulation A X Y W H PERIOD    of a vertical grating of about PERIOD pixels in a part of A
//   measure strokes A STEP R0 R1 REACH     rms half width (pixels) of a dial's stroke every STEP degrees,
//                                          between radii R0 and R1
//   measure dark A X Y W H                 centroid and extent (pixels) of the dark in a part of A
//   measure match A B X Y W H              where that part of A lies in B, to a fraction of a pixel
//   measure smear A                        structure tensor: direction of blur (degrees, TABO), coherence
//   measure colour A                       mean and extreme differences of the channels
//   measure sheet OUT COLUMNS WIDTH A[@X,Y,W,H]=LABEL..   pictures (or parts of them) side by side, WIDTH
//                                          pixels each, with labels
//   measure movie OUT FPS A...             an AVI (Motion JPEG)
// Pictures are read as linear light, but for ssim, which the paper counts in encoded grey levels.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

cv::Mat read(const std::string& file, int flags) {
  cv::Mat picture = cv::imread(file, flags);
  if (picture.empty()) throw std::runtime_error("cannot read " + file);
  return picture;
}

double linear(double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); }

/// Linear grey light, 0 to 1.
cv::Mat light(const std::string& file) {
  const cv::Mat raw = read(file, cv::IMREAD_UNCHANGED);
  cv::Mat result(raw.size(), CV_64F);
  for (int y = 0; y < raw.rows; ++y)
    for (int x = 0; x < raw.cols; ++x) {
      double bgr[3];
      for (int c = 0; c < 3; ++c)
        bgr[c] = raw.depth() == CV_32F
                     ? raw.ptr<float>(y)[x * raw.channels() + c % raw.channels()]
                     : linear(raw.ptr<unsigned char>(y)[x * raw.channels() + c % raw.channels()] / 255.0);
      result.at<double>(y, x) = 0.0722 * bgr[0] + 0.7152 * bgr[1] + 0.2126 * bgr[2];
    }
  return result;
}

double bilinear(const cv::Mat& m, double x, double y) {
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  if (i < 0 || j < 0 || i + 1 >= m.cols || j + 1 >= m.rows) return 1;
  const double u = x - i, v = y - j;
  return (1 - v) * ((1 - u) * m.at<double>(j, i) + u * m.at<double>(j, i + 1)) +
         v * ((1 - u) * m.at<double>(j + 1, i) + u * m.at<double>(j + 1, i + 1));
}

/// Wang et al. (2004): Gaussian window of 1.5 pixels, K 0.01 and 0.03, on grey levels.
void ssim(const std::string& a_file, const std::string& b_file) {
  cv::Mat a, b;
  read(a_file, cv::IMREAD_GRAYSCALE).convertTo(a, CV_64F);
  read(b_file, cv::IMREAD_GRAYSCALE).convertTo(b, CV_64F);
  if (a.size() != b.size()) throw std::runtime_error("pictures of different sizes");
  const auto blur = [](const cv::Mat& m) {
    cv::Mat out;
    cv::GaussianBlur(m, out, {11, 11}, 1.5);
    return out;
  };
  const double c1 = std::pow(0.01 * 255, 2), c2 = std::pow(0.03 * 255, 2);
  const cv::Mat ma = blur(a), mb = blur(b);
  const cv::Mat va = blur(a.mul(a)) - ma.mul(ma), vb = blur(b.mul(b)) - mb.mul(mb),
                ab = blur(a.mul(b)) - ma.mul(mb);
  cv::Mat ratio;
  cv::divide((2 * ma.mul(mb) + c1).mul(2 * ab + c2), (ma.mul(ma) + mb.mul(mb) + c1).mul(va + vb + c2), ratio);
  const cv::Mat d = a - b;
  std::printf("{\"msd\": %.6f, \"ssim\": %.6f}\n", cv::mean(d.mul(d))[0], cv::mean(ratio)[0]);
}

cv::Rect inside(const cv::Mat& picture, const cv::Rect& rect) {
  if ((rect & cv::Rect(0, 0, picture.cols, picture.rows)) != rect || rect.area() == 0)
    throw std::runtime_error("the part lies outside the picture");
  return rect;
}

cv::Rect part(const cv::Mat& picture, char** v) {
  return inside(picture, {std::atoi(v[0]), std::atoi(v[1]), std::atoi(v[2]), std::atoi(v[3])});
}

/// Largest amplitude of a vertical grating within 12 % of the period, over the mean; Hann window.
void modulation(const cv::Mat& grey, const cv::Rect& rect, double period) {
  std::vector<double> row(rect.width);
  double mean = 0, windows = 0;
  const auto window = [&](int i) { return 0.5 - 0.5 * std::cos(2 * CV_PI * (i + 0.5) / rect.width); };
  for (int i = 0; i < rect.width; ++i) {
    row[i] = cv::mean(grey(cv::Rect(rect.x + i, rect.y, 1, rect.height)))[0];
    mean += window(i) * row[i];
    windows += window(i);
  }
  mean /= windows;
  double best = 0, at = 0;
  for (double p = 0.88 * period; p <= 1.12 * period; p += 0.001 * period) {
    double c = 0, s = 0;
    for (int i = 0; i < rect.width; ++i) {
      c += window(i) * (row[i] - mean) * std::cos(2 * CV_PI * i / p);
      s += window(i) * (row[i] - mean) * std::sin(2 * CV_PI * i / p);
    }
    if (const double amplitude = 2 * std::hypot(c, s) / windows; amplitude > best) best = amplitude, at = p;
  }
  std::printf("{\"modulation\": %.6f, \"period\": %.4f, \"mean\": %.5f}\n", best / mean, at, mean);
}

/// Second moment of the dark across each stroke, both of its ends together.
void strokes(const cv::Mat& grey, double step_deg, double r0, double r1, double reach) {
  std::printf("{\"strokes\": [");
  for (int k = 0; k * step_deg < 180; ++k) {
    const double angle = k * step_deg * CV_PI / 180, c = std::cos(angle), s = std::sin(angle);
    double sum = 0, first = 0, second = 0;
    for (const double side : {-1.0, 1.0}) {
      double part_sum = 0, part_first = 0, part_second = 0;
      for (double t = -reach; t <= reach; t += 0.25) {
        double dark = 0;
        for (double r = r0; r <= r1; r += 0.5) {
          // the patient sees x to the right; TABO counts angles as the examiner does, from the patient's left
          const double x = -(side * r * c - t * s), y = -(side * r * s + t * c);
          dark += 1 - bilinear(grey, (grey.cols - 1) / 2.0 + x, (grey.rows - 1) / 2.0 + y);
        }
        part_sum += dark;
        part_first += dark * t;
        part_second += dark * t * t;
      }
      sum += part_sum;
      first += part_first;
      second += part_second - part_first * part_first / part_sum;
    }
    std::printf("%s{\"angle_deg\": %g, \"rms\": %.5f}", k ? ", " : "", k * step_deg, std::sqrt(second / sum));
  }
  std::printf("]}\n");
}

void dark(const cv::Mat& grey, const cv::Rect& rect) {
  double sum = 0, x = 0, y = 0, xx = 0, yy = 0;
  for (int j = rect.y; j < rect.y + rect.height; ++j)
    for (int i = rect.x; i < rect.x + rect.width; ++i) {
      const double w = std::max(0.0, 1 - grey.at<double>(j, i));
      sum += w, x += w * i, y += w * j, xx += w * i * i, yy += w * j * j;
    }
  x /= sum, y /= sum;
  std::printf("{\"x\": %.5f, \"y\": %.5f, \"rms_x\": %.5f, \"rms_y\": %.5f, \"sum\": %.5f}\n", x, y,
              std::sqrt(std::max(0.0, xx / sum - x * x)), std::sqrt(std::max(0.0, yy / sum - y * y)), sum);
}

void match(const std::string& a_file, const std::string& b_file, char** v) {
  const cv::Mat a = read(a_file, cv::IMREAD_COLOR), b = read(b_file, cv::IMREAD_COLOR);
  const cv::Rect rect = part(a, v);
  cv::Mat score;
  cv::matchTemplate(b, a(rect), score, cv::TM_CCOEFF_NORMED);
  cv::Point at;
  double best = 0;
  cv::minMaxLoc(score, nullptr, &best, nullptr, &at);
  const auto peak = [&](int dx, int dy) {
    const int x = std::clamp(at.x + dx, 0, score.cols - 1), y = std::clamp(at.y + dy, 0, score.rows - 1);
    return static_cast<double>(score.at<float>(y, x));
  };
  const auto fraction = [](double l, double m, double r) {
    return l + r - 2 * m == 0 ? 0 : 0.5 * (l - r) / (l + r - 2 * m);
  };
  std::printf("{\"shift_x\": %.4f, \"shift_y\": %.4f, \"correlation\": %.5f}\n",
              at.x + fraction(peak(-1, 0), best, peak(1, 0)) - rect.x,
              at.y + fraction(peak(0, -1), best, peak(0, 1)) - rect.y, best);
}

/// Along the blur the picture changes least: the weaker eigenvector of the mean gradient tensor.
void smear(const cv::Mat& grey) {
  cv::Mat gx, gy;
  cv::Sobel(grey, gx, CV_64F, 1, 0);
  cv::Sobel(grey, gy, CV_64F, 0, 1);
  const double xx = cv::mean(gx.mul(gx))[0], yy = cv::mean(gy.mul(gy))[0],
               xy = -cv::mean(gx.mul(gy))[0];  // y up
  const double gradient = 0.5 * std::atan2(2 * xy, xx - yy) * 180 / CV_PI;
  // the picture's x is the patient's right, TABO's the patient's left: mirrored
  double along = std::fmod(180 - (gradient + 90) + 360, 180);
  std::printf("{\"direction_deg\": %.3f, \"coherence\": %.5f}\n", along,
              std::hypot(xx - yy, 2 * xy) / (xx + yy));
}

void colour(const std::string& file) {
  const cv::Mat picture = read(file, cv::IMREAD_COLOR);
  std::vector<cv::Mat> bgr;
  cv::split(picture, bgr);
  cv::Mat difference;
  cv::absdiff(bgr[0], bgr[2], difference);
  double most = 0;
  cv::minMaxLoc(difference, nullptr, &most);
  std::printf("{\"mean_difference\": %.4f, \"largest_difference\": %.1f}\n", cv::mean(difference)[0], most);
}

void sheet(int count, char** v) {
  const std::string out = v[0];
  const int columns = std::atoi(v[1]), width = std::atoi(v[2]);
  constexpr int label = 20, gap = 4;
  std::vector<cv::Mat> cells;
  int height = 0;
  for (int i = 3; i < count; ++i) {
    const std::string item = v[i];
    const std::size_t equals = item.find('=');
    const std::size_t at = std::min(item.rfind('@', equals), equals);
    cv::Mat picture = read(item.substr(0, at), cv::IMREAD_COLOR);
    if (int x, y, w, h; at != equals && std::sscanf(item.c_str() + at, "@%d,%d,%d,%d", &x, &y, &w, &h) == 4)
      picture = picture(inside(picture, {x, y, w, h}));
    cv::resize(picture, picture, {width, picture.rows * width / picture.cols}, 0, 0,
               picture.cols > width ? cv::INTER_AREA : cv::INTER_LINEAR);
    cv::copyMakeBorder(picture, picture, label, gap, gap / 2, gap / 2, cv::BORDER_CONSTANT,
                       cv::Scalar(255, 255, 255));
    if (equals != std::string::npos)
      cv::putText(picture, item.substr(equals + 1), {gap, 14}, cv::FONT_HERSHEY_SIMPLEX, 0.42,
                  cv::Scalar(0, 0, 0), 1, cv::LINE_AA);
    height = std::max(height, picture.rows);
    cells.push_back(picture);
  }
  const int rows = (static_cast<int>(cells.size()) + columns - 1) / columns;
  cv::Mat page(rows * height, columns * cells.front().cols, CV_8UC3, cv::Scalar(255, 255, 255));
  for (std::size_t i = 0; i < cells.size(); ++i)
    cells[i].copyTo(page(cv::Rect(static_cast<int>(i) % columns * cells[i].cols,
                                  static_cast<int>(i) / columns * height, cells[i].cols, cells[i].rows)));
  if (!cv::imwrite(out, page, {cv::IMWRITE_PNG_COMPRESSION, 9}))
    throw std::runtime_error("cannot write " + out);
  std::printf("{\"pictures\": %zu}\n", cells.size());
}

void movie(int count, char** v) {
  const cv::Mat first = read(v[2], cv::IMREAD_COLOR);
  cv::VideoWriter writer(v[0], cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), std::atof(v[1]), first.size());
  if (!writer.isOpened()) throw std::runtime_error(std::string("cannot write ") + v[0]);
  for (int i = 2; i < count; ++i) writer.write(read(v[i], cv::IMREAD_COLOR));
  std::printf("{\"frames\": %d}\n", count - 2);
}

}  // namespace

int main(int count, char** v) {
  try {
    const std::string what = count > 1 ? v[1] : "";
    if (what == "ssim" && count == 4) {
      ssim(v[2], v[3]);
    } else if (what == "modulation" && count == 8) {
      const cv::Mat grey = light(v[2]);
      modulation(grey, part(grey, v + 3), std::atof(v[7]));
    } else if (what == "strokes" && count == 7) {
      strokes(light(v[2]), std::atof(v[3]), std::atof(v[4]), std::atof(v[5]), std::atof(v[6]));
    } else if (what == "dark" && count == 7) {
      const cv::Mat grey = light(v[2]);
      dark(grey, part(grey, v + 3));
    } else if (what == "match" && count == 8) {
      match(v[2], v[3], v + 4);
    } else if (what == "smear" && count == 3) {
      smear(light(v[2]));
    } else if (what == "colour" && count == 3) {
      colour(v[2]);
    } else if (what == "sheet" && count > 5) {
      sheet(count - 2, v + 2);
    } else if (what == "movie" && count > 4) {
      movie(count - 2, v + 2);
    } else {
      std::fprintf(stderr, "measure: wrong usage; see the head of docs/evidence/paper/measure.cpp\n");
      return 2;
    }
  } catch (const std::exception& fault) {
    std::fprintf(stderr, "measure: %s\n", fault.what());
    return 1;
  }
  return 0;
}
