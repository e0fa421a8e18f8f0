#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "raytrace/device/device_picture.hpp"

namespace emmetrope::raytrace {

/// A picture on several devices, each with rows of its own.
class SharedPicture {
 public:
  /// Both arguments outlive it.
  /// \throw Error (no_device) of the first device that failed
  SharedPicture(const std::vector<std::unique_ptr<OpenCl>>& devices, const PictureJob& job);

  /// Nothing yet.
  PictureSums no_samples() const;
  /// Traces further samples, at least so many, of the sequence that `seed` starts.
  void add_samples(PictureSums& sums, std::uint64_t seed, int samples, const std::string& doing,
                   Verbosity verbosity);

  struct Estimate {
    PictureSums sums;
    double standard_error;  ///< of their mean, rms over pixels and channels, in levels of 255
  };
  /// Two halves, each a sequence of its own, which grow until half their difference is small enough or there
  /// are `most` samples in all.
  Estimate until(double standard_error, std::uint64_t seed, int most, Verbosity verbosity);

  std::uint64_t bytes() const;

 private:
  void on_all(const std::function<void(std::size_t)>& work) const;
  int rounded_up(double samples) const;

  const std::vector<std::unique_ptr<OpenCl>>& devices_;
  const PictureJob& job_;
  std::vector<std::vector<Band>> bands_;
  std::vector<std::optional<DevicePicture>> parts_;
};

}  // namespace emmetrope::raytrace
