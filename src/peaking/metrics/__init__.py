"""How close a rendered picture is to a photograph: PSNR, SSIM, FLIP and LPIPS, one file each."""
